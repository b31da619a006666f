//! An archive of a few small files: PKZIP's `APPNOTE.TXT`, 6.3, without compression.
//!
//! Each file has a header before its bytes and one more in the directory at the end, whose place the last record
//! tells. Times are left at the format's first day, so that the same files give the same bytes.

use crate::Error;
use flate2::Crc;

const LOCAL: u32 = 0x0403_4b50;
const CENTRAL: u32 = 0x0201_4b50;
const END: u32 = 0x0605_4b50;

/// Version 1.0 of the format reads it.
const NEEDED: u16 = 10;
/// Names are UTF-8.
const FLAGS: u16 = 1 << 11;
/// 1 January 1980.
const FIRST_DAY: u16 = (1 << 5) | 1;

/// The archive of `files`, each a path with `/` between parts and what it holds.
///
/// # Errors
/// Where they are more or larger than the format's 16 and 32 bits tell (65535 files, 4 GiB).
pub(super) fn archive<'a>(files: impl IntoIterator<Item = (&'a str, &'a [u8])>) -> Result<Vec<u8>, Error> {
    let too_large = |_| Error::Failed("the archive passes 65535 files or 4 GiB; archive fewer".to_owned());
    let (mut out, mut directory, mut count) = (Vec::new(), Vec::new(), 0usize);
    for (path, bytes) in files {
        let start = u32::try_from(out.len()).map_err(too_large)?;
        let common = common_header(path, bytes).map_err(too_large)?;
        out.extend([&LOCAL.to_le_bytes()[..], &common, path.as_bytes(), bytes].concat());
        // Made by; then comment, disk and attributes, all empty.
        directory.extend([&CENTRAL.to_le_bytes()[..], &NEEDED.to_le_bytes(), &common, &[0; 10]].concat());
        directory.extend([&start.to_le_bytes()[..], path.as_bytes()].concat());
        count += 1;
    }
    let start = u32::try_from(out.len()).map_err(too_large)?.to_le_bytes();
    let length = u32::try_from(directory.len()).map_err(too_large)?.to_le_bytes();
    let count = u16::try_from(count).map_err(too_large)?.to_le_bytes();
    // This disk, and that of the directory; files here, and in all; no comment.
    let end = [&END.to_le_bytes()[..], &[0; 4], &count, &count, &length, &start, &[0; 2]].concat();
    Ok([out, directory, end].concat())
}

/// What both headers of a file say, from the version that reads it to the lengths of name and extra field.
fn common_header(path: &str, bytes: &[u8]) -> Result<Vec<u8>, std::num::TryFromIntError> {
    let mut crc = Crc::new();
    crc.update(bytes);
    let size = u32::try_from(bytes.len())?.to_le_bytes();
    let name = u16::try_from(path.len())?.to_le_bytes();
    // No compression, midnight; compressed size and size are the same; no extra field.
    let head = [NEEDED, FLAGS, 0, 0, FIRST_DAY].map(u16::to_le_bytes);
    Ok([head.as_flattened(), &crc.sum().to_le_bytes(), &size, &size, &name, &[0; 2]].concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_lies_where_the_directory_says() {
        let bytes = archive([("a/b.txt", b"123456789".as_slice()), ("c", b"".as_slice())]).unwrap();
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let end = bytes.len() - 22;
        let directory = word(end + 16) as usize;
        assert_eq!((word(0), word(directory), word(end)), (LOCAL, CENTRAL, END));
        assert_eq!(directory + word(end + 12) as usize, end, "the directory ends where the last record begins");
        // The check value of CRC-32 in every catalogue.
        assert_eq!((word(14), word(directory + 16)), (0xcbf4_3926, 0xcbf4_3926));
        assert_eq!(&bytes[30..46], b"a/b.txt123456789");
        let second = directory + 46 + 7;
        assert_eq!((word(second), word(second + 42)), (CENTRAL, 46), "the second file begins behind the first");
        assert_eq!(word(46), LOCAL);
    }
}
