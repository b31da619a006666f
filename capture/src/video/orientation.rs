//! How a film was held: read from the file itself, because OpenCV 4.6 with FFmpeg 5 turns the wrong way.
//!
//! Films of the .mp4 and .mov family keep a matrix per track that maps its pixels to the screen (ISO 14496-12,
//! track header box). Other kinds do not say.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Larger heads than this are no head of a film.
const MOST_BYTES: u64 = 1 << 28;

/// Quarter turns clockwise that bring the frames of a film upright, 0 to 3; 0 where the film does not say, or says
/// anything but quarter turns.
pub(super) fn quarter_turns(path: &Path) -> u8 {
    movie_box(path).and_then(|movie| video_matrix(&movie)).map_or(0, turns)
}

fn turns([a, b, c, d]: [i32; 4]) -> u8 {
    // x' = a x + c y, y' = b x + d y, y down; 1 is 2¹⁶.
    match [a, b, c, d].map(i32::signum) {
        [0, 1, -1, 0] => 1,
        [-1, 0, 0, -1] => 2,
        [0, -1, 1, 0] => 3,
        _ => 0,
    }
}

/// The body of the box that describes all tracks.
fn movie_box(path: &Path) -> Option<Vec<u8>> {
    let mut file = File::open(path).ok()?;
    loop {
        let mut head = [0; 16];
        file.read_exact(&mut head[..8]).ok()?;
        let short = u64::from(u32::from_be_bytes(head[..4].try_into().ok()?));
        // Size 1: the true size follows in 64 bits. Size 0: to the end of the file, never before the one sought.
        let (size, head_size) = if short == 1 {
            file.read_exact(&mut head[8..]).ok()?;
            (u64::from_be_bytes(head[8..].try_into().ok()?), 16)
        } else {
            (short, 8)
        };
        let body = size.checked_sub(head_size)?;
        if &head[4..8] == b"moov" {
            let mut movie = Vec::new();
            file.take(body.min(MOST_BYTES)).read_to_end(&mut movie).ok()?;
            return Some(movie);
        }
        file.seek(SeekFrom::Current(i64::try_from(body).ok()?)).ok()?;
    }
}

/// The four numbers of the matrix of the first track with pictures.
fn video_matrix(movie: &[u8]) -> Option<[i32; 4]> {
    let is_video = |track: &&[u8]| {
        let handler = boxes(track).find(|(name, _)| name == b"mdia").and_then(|(_, media)| body(media, b"hdlr"));
        handler.and_then(|handler| handler.get(8..12)) == Some(b"vide")
    };
    let track = boxes(movie).filter(|(name, _)| name == b"trak").map(|(_, track)| track).find(is_video)?;
    let header = body(track, b"tkhd")?;
    // Version 1 keeps its times in 64 bits.
    let matrix = if *header.first()? == 1 { 52 } else { 40 };
    let number = |i: usize| {
        let at = matrix + 4 * i;
        Some(i32::from_be_bytes(header.get(at..at + 4)?.try_into().ok()?))
    };
    Some([number(0)?, number(1)?, number(3)?, number(4)?])
}

fn body<'a>(boxes_of: &'a [u8], wanted: &[u8; 4]) -> Option<&'a [u8]> {
    boxes(boxes_of).find(|(name, _)| name == wanted).map(|(_, body)| body)
}

/// Names and bodies of the boxes that lie one after the other; ends where a size cannot be.
fn boxes(mut bytes: &[u8]) -> impl Iterator<Item = ([u8; 4], &[u8])> {
    std::iter::from_fn(move || {
        let size = u32::from_be_bytes(bytes.get(..4)?.try_into().ok()?) as usize;
        let name = bytes.get(4..8)?.try_into().ok()?;
        let body = bytes.get(8..size)?;
        bytes = &bytes[size..];
        Some((name, body))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_that_lie_turn_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.mp4");
        let head = |size: u32, name: &[u8; 4]| [&size.to_be_bytes()[..], name].concat();
        for bytes in [
            Vec::new(),
            head(0, b"free"),
            head(7, b"moov"),
            head(u32::MAX, b"moov"),
            [head(1, b"mdat"), u64::MAX.to_be_bytes().to_vec()].concat(),
            [head(24, b"moov"), head(u32::MAX, b"trak"), head(4, b"tkhd")].concat(),
        ] {
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(quarter_turns(&path), 0);
        }
    }

    #[test]
    fn matrices_are_turns_or_nothing() {
        let one = 1 << 16;
        assert_eq!(turns([one, 0, 0, one]), 0);
        assert_eq!(turns([0, one, -one, 0]), 1);
        assert_eq!(turns([-one, 0, 0, -one]), 2);
        assert_eq!(turns([0, -one, one, 0]), 3);
        assert_eq!(turns([one, one, -one, one]), 0);
    }
}
