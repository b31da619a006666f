//! The `turnlight` command: reads arguments, calls the library, prints what came of it.
//!
//! Standard output holds the answer alone (one JSON document with `--json`); progress and faults go to
//! standard error. Exit code 0 done, 1 the work failed, 2 the arguments are wrong.

mod arguments;
mod commands;
mod progress;

use arguments::{Cli, Command};
use clap::Parser;
use progress::Progress;
use std::io::Write;
use std::process::ExitCode;
use turnlight::Error;

/// What a command has to say: to a person, and to a program.
struct Answer {
    text: String,
    json: serde_json::Value,
}

fn main() -> ExitCode {
    #[cfg(feature = "video")]
    silence_ffmpeg();
    let cli = Cli::parse();
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// FFmpeg prints its own faults on standard error; ours name the file and the remedy. Whoever wants to hear it sets the
/// variable (OpenCV's, a level of libavutil: -8 is none).
#[cfg(feature = "video")]
#[allow(unsafe_code, reason = "OpenCV takes this setting from the environment alone")]
fn silence_ffmpeg() {
    const LEVEL: &str = "OPENCV_FFMPEG_LOGLEVEL";
    if std::env::var_os(LEVEL).is_none() {
        // SAFETY: called first in `main`, before any other thread is started.
        unsafe { std::env::set_var(LEVEL, "-8") };
    }
}

fn run(cli: &Cli) -> Result<(), Error> {
    if let Some(threads) = cli.general.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        pool.map_err(|fault| Error::Failed(format!("{threads} threads cannot be started: {fault}; ask for fewer")))?;
    }
    let progress = Progress::new(cli.general.quiet, cli.general.verbose);
    let answer = match &cli.command {
        Command::Bench(command) => commands::bench::run(command, &progress),
        Command::Board(args) => commands::board::run(args),
        Command::Btf(command) => commands::btf::run(command, &progress),
        Command::Capture(args) => commands::capture::run(args, &progress),
        Command::Compare(args) => commands::compare::run(args, &progress),
        Command::Demo(args) => commands::demo::run(args, &progress),
        Command::Export(args) => commands::export::run(args),
        Command::Hull(args) => commands::hull::run(args, &progress),
        Command::Import(args) => commands::import::run(args, &progress),
        Command::Info(args) => commands::info::run(args, &progress),
        Command::Model(args) => commands::model::run(args, &progress),
        Command::Render(args) => commands::render::run(args, &progress),
        Command::Synth(args) => commands::synth::run(args, &progress),
        Command::Turntable(args) => commands::turntable::run(args, &progress),
        Command::View(args) => {
            progress.finish();
            return commands::view::run(args, |answer| say(cli, answer));
        }
    }?;
    progress.finish();
    say(cli, &answer)
}

/// Prints the answer as it was asked for.
fn say(cli: &Cli, answer: &Answer) -> Result<(), Error> {
    if cli.general.json {
        print(&format!("{:#}", answer.json))
    } else if !cli.general.quiet {
        print(&answer.text)
    } else {
        Ok(())
    }
}

/// Prints the answer. A reader that has gone away, as `head` does, is no fault.
fn print(answer: &str) -> Result<(), Error> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{}", answer.trim_end()).and_then(|()| out.flush()) {
        Err(fault) if fault.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::Failed(format!("standard output: {fault}; print elsewhere")))
        }
        _ => Ok(()),
    }
}
