//! `turnlight btf`

use super::synth::refuse_occupied;
use crate::Answer;
use crate::arguments::{BtfCommand, BtfSynthArgs};
use serde_json::json;
use turnlight::Error;
use turnlight::data_synth::btf::{BtfMaterial, BtfOptions, DIRECTIONS, write_btf};
use turnlight::stages::{Observer, Stages};

pub(crate) fn run(command: &BtfCommand, observer: &dyn Observer) -> Result<Answer, Error> {
    match command {
        BtfCommand::Synth(args) => synth(args, observer),
    }
}

fn synth(args: &BtfSynthArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let material: BtfMaterial = args.material.parse().map_err(|fault| Error::Arguments(format!("{fault}")))?;
    refuse_occupied(&args.output)?;
    let options = BtfOptions { size: args.size, seed: args.seed, samples: args.samples, ..BtfOptions::default() };
    let mut stages = Stages::new(observer);
    let measure = |observer: &dyn Observer| {
        write_btf(material, &options, args.hdr, &args.output, |done, total| observer.advanced(done, total))
    };
    let written = stages.run("measure", measure)?;
    let size = args.size;
    let text = format!(
        "{material}: {DIRECTIONS} views × {DIRECTIONS} lights of {size} × {size} texels, {:.3} mm apart\nwrote {}",
        written.texel_pitch_mm,
        args.output.display()
    );
    let json = json!({
        "material": material.name(),
        "size": size,
        "views": DIRECTIONS,
        "lights": DIRECTIONS,
        "seed": args.seed,
        "samples": args.samples,
        "hdr": args.hdr,
        "exposure": written.exposure,
        "texel_pitch_mm": written.texel_pitch_mm,
        "bytes": written.bytes,
        "btf": args.output,
        "stages": stages.finished(),
    });
    Ok(Answer { text, json })
}
