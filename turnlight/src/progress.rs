//! What a person sees of long work: a bar on a terminal, one line per stage otherwise.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::time::Duration;
use turnlight::stages::{Observer, Stage};

/// Reports on standard error.
pub(crate) struct Progress {
    bar: Option<ProgressBar>,
    quiet: bool,
    verbose: bool,
}

impl Progress {
    pub(crate) fn new(quiet: bool, verbose: u8) -> Self {
        let on_terminal = std::io::stderr().is_terminal() && !quiet;
        Self { bar: on_terminal.then(new_bar), quiet, verbose: verbose > 0 }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    fn line(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| eprintln!("{text}")),
            None => eprintln!("{text}"),
        }
    }
}

fn new_bar() -> ProgressBar {
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    bar.set_style(spinner());
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

fn spinner() -> ProgressStyle {
    ProgressStyle::with_template("{spinner} {msg} {elapsed}").unwrap_or_else(|_| ProgressStyle::default_spinner())
}

fn steps() -> ProgressStyle {
    let style = ProgressStyle::with_template("{spinner} {msg} {bar:32} {pos}/{len} {elapsed}");
    style.unwrap_or_else(|_| ProgressStyle::default_bar())
}

fn counter() -> ProgressStyle {
    ProgressStyle::with_template("{spinner} {msg} {pos} {elapsed}").unwrap_or_else(|_| ProgressStyle::default_spinner())
}

impl Observer for Progress {
    fn began(&self, stage: &str) {
        if let Some(bar) = &self.bar {
            bar.reset();
            bar.unset_length();
            bar.set_style(spinner());
            bar.set_message(stage.to_owned());
        }
    }

    fn advanced(&self, done: usize, total: usize) {
        if let Some(bar) = &self.bar {
            // Films do not say how long they are.
            if total > 0 {
                bar.set_style(steps());
                bar.set_length(total as u64);
            } else {
                bar.set_style(counter());
            }
            bar.set_position(done as u64);
        }
    }

    fn ended(&self, stage: &Stage) {
        if self.quiet || (self.bar.is_some() && !self.verbose) {
            return;
        }
        let peak = match stage.peak_bytes {
            Some(bytes) if self.verbose => format!(", peak {} MiB", bytes >> 20),
            _ => String::new(),
        };
        self.line(&format!("{}: {:.2} s{peak}", stage.stage, stage.seconds));
    }

    fn noted(&self, note: &str) {
        if !self.quiet {
            self.line(note);
        }
    }
}
