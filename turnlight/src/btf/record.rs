//! What a fit took, kept beside the file it made: `m.btfz` has `m.btfz.json`.
//!
//! Times and memory differ from run to run, a `.btfz` does not: hence they do not stand in it. The record names the checksum
//! of its material, so that what was copied, renamed or fitted again since is not taken for it.

use crate::Error;
use crate::output::write_file;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use texture::btf::container::checksum;

/// What a fit took.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitRecord {
    /// CRC-32 of the material's file, as stands in it.
    pub checksum: u32,
    /// Wall clock of the fit, data read and file not yet written.
    pub fit_s: f64,
    /// The most memory the process that fitted has held, data included; `None` where the system does not tell.
    pub fit_peak_bytes: Option<u64>,
}

impl FitRecord {
    /// Of a material's file.
    pub fn new(material: &[u8], fit_s: f64, fit_peak_bytes: Option<u64>) -> Self {
        Self { checksum: checksum(material), fit_s, fit_peak_bytes }
    }

    /// Where the record of a material lies.
    pub fn path(material: &Path) -> PathBuf {
        let mut name = OsString::from(material);
        name.push(".json");
        name.into()
    }

    /// Writes the record of the material at `path`.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        write_file(&Self::path(path), format!("{:#}\n", json!(self)).as_bytes())
    }

    /// The record of the material at `path`, whose bytes are `material`; `None` where there is none, or that of another.
    pub fn read(path: &Path, material: &[u8]) -> Option<Self> {
        let text = std::fs::read(Self::path(path)).ok()?;
        let record: Self = serde_json::from_slice(&text).ok()?;
        (record.checksum == checksum(material)).then_some(record)
    }
}
