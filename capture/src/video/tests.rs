use super::*;
use std::fs;
use std::path::PathBuf;

const FRAMES: usize = 30;
const SIZE: [usize; 2] = [160, 96];

/// A smooth ground, and the frame's number as eight light or dark blocks.
fn counted(number: usize) -> Image<[u8; 3]> {
    let [width, height] = SIZE;
    let mut image = Image::filled(width, height, [0; 3]);
    for y in 0..height {
        for x in 0..width {
            let ground = [40 + x, 60 + y, 200 - x / 2].map(|v| v as u8);
            let block = x / 16;
            let is_bit = (24..40).contains(&y) && (1..9).contains(&block);
            let bit = if number >> (block.max(1) - 1) & 1 == 1 { [230; 3] } else { [20; 3] };
            image.set(x, y, if is_bit { bit } else { ground });
        }
    }
    image
}

/// The number in the blocks.
fn number(image: &Image<[u8; 3]>) -> usize {
    (0..8).map(|bit| usize::from(image.at(16 * (bit + 1) + 8, 32)[1] > 128) << bit).sum()
}

fn psnr(a: &Image<[u8; 3]>, b: &Image<[u8; 3]>) -> f64 {
    let pairs = a.pixels().as_flattened().iter().zip(b.pixels().as_flattened());
    let squares: f64 = pairs.map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2)).sum();
    10.0 * (255.0_f64.powi(2) * (3 * a.pixels().len()) as f64 / squares.max(1e-9)).log10()
}

fn write(path: &Path, fps: f64) -> Written {
    let mut film = FilmWriter::create(path, SIZE, &WriteOptions { fps, ..WriteOptions::default() }).unwrap();
    (0..FRAMES).for_each(|i| film.push(&counted(i)).unwrap());
    film.finish().unwrap()
}

fn read(path: &Path) -> Result<Vec<FilmFrame>, CaptureError> {
    FilmReader::open(path, &ReadOptions::default())?.collect()
}

fn place(name: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    (folder, path)
}

#[test]
fn frames_come_back_in_order_and_in_time() {
    for (name, codec, least_db) in [
        ("film.mp4", Codec::H264, 34.0),
        ("film.mov", Codec::H264, 34.0),
        ("film.avi", Codec::MotionJpeg, 34.0),
        ("film.mkv", Codec::Ffv1, 40.0),
    ] {
        let (folder, path) = place(name);
        assert_eq!(write(&path, 24.0), Written { frames: FRAMES, codec }, "{name}");
        // Nothing is left beside it.
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "{name}");
        let film = FilmReader::open(&path, &ReadOptions::default()).unwrap();
        let info = film.info();
        assert_eq!((info.width, info.height, info.frames), (SIZE[0], SIZE[1], FRAMES), "{name}");
        assert!((info.fps - 24.0).abs() < 0.01, "{name}: {}", info.fps);
        let frames: Vec<FilmFrame> = film.map(Result::unwrap).collect();
        assert_eq!(frames.len(), FRAMES, "{name}");
        let worst = frames.iter().map(|f| psnr(&f.image, &counted(f.index))).fold(f64::INFINITY, f64::min);
        println!("{name}: {} bytes, worst {worst:.1} dB", fs::metadata(&path).unwrap().len());
        assert!(worst > least_db, "{name}: {worst}");
        for (i, frame) in frames.iter().enumerate() {
            assert_eq!((frame.index, number(&frame.image)), (i, i), "{name}");
            // Containers count milliseconds, or finer.
            assert!((frame.time_s - i as f64 / 24.0).abs() < 1.1e-3, "{name} {i}: {}", frame.time_s);
        }
    }
}

#[test]
fn a_film_is_read_smaller_if_asked() {
    let (_folder, path) = place("film.mkv");
    write(&path, 30.0);
    let film = FilmReader::open(&path, &ReadOptions { downscale: 2 }).unwrap();
    assert_eq!((film.info().width, film.info().height), (80, 48));
    let frame = film.last().unwrap().unwrap();
    assert_eq!((frame.image.width(), frame.image.height(), frame.index), (80, 48, FRAMES - 1));
    for downscale in [0, 97] {
        let fault = FilmReader::open(&path, &ReadOptions { downscale }).unwrap_err();
        assert!(matches!(fault, CaptureError::Downscale { .. }), "{fault}");
    }
}

/// Where box `name` of an mp4 file starts, inside the boxes before it.
fn find_box(bytes: &[u8], names: &[&[u8; 4]]) -> usize {
    let (mut at, mut end) = (0, bytes.len());
    for (depth, name) in names.iter().enumerate() {
        loop {
            assert!(at < end, "no {}", String::from_utf8_lossy(*name));
            let size = u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
            if &bytes[at + 4..at + 8] == *name {
                end = at + size;
                break;
            }
            at += size;
        }
        at += if depth + 1 < names.len() { 8 } else { 0 };
    }
    at
}

#[test]
fn a_film_taken_upright_comes_out_upright() {
    let one = 1 << 16;
    let [width, height] = SIZE;
    // As phones write it. Where the film's pixel (x, y) is on the screen, from the matrix by hand.
    type Place = fn(usize, usize) -> [usize; 2];
    let held: [([i32; 4], Place); 3] = [
        ([0, one, -one, 0], |x, y| [SIZE[1] - 1 - y, x]),
        ([-one, 0, 0, -one], |x, y| [SIZE[0] - 1 - x, SIZE[1] - 1 - y]),
        ([0, -one, one, 0], |x, y| [y, SIZE[0] - 1 - x]),
    ];
    let (_folder, path) = place("film.mp4");
    write(&path, 30.0);
    for ([a, b, c, d], place) in held {
        let mut bytes = fs::read(&path).unwrap();
        // The matrix is nine numbers 40 bytes into the body of version 0: [a b u c d v x y w].
        let matrix = find_box(&bytes, &[b"moov", b"trak", b"tkhd"]) + 8 + 40;
        for (position, value) in [(0, a), (1, b), (3, c), (4, d)] {
            bytes[matrix + 4 * position..][..4].copy_from_slice(&value.to_be_bytes());
        }
        fs::write(&path, bytes).unwrap();
        for frame in read(&path).unwrap() {
            let mut as_coded = Image::filled(width, height, [0; 3]);
            for y in 0..height {
                for x in 0..width {
                    let [u, v] = place(x, y);
                    as_coded.set(x, y, frame.image.at(u, v));
                }
            }
            assert_eq!(number(&as_coded), frame.index);
            assert!(psnr(&as_coded, &counted(frame.index)) > 34.0);
        }
    }
}

#[test]
fn timestamps_follow_a_rate_that_varies() {
    let (_folder, path) = place("film.mp4");
    write(&path, 30.0);
    let mut bytes = fs::read(&path).unwrap();
    let names: [&[u8; 4]; 6] = [b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stts"];
    let table = find_box(&bytes, &names);
    let number = |bytes: &[u8], at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    // One run of 30 equal durations becomes two of 15, the second of double length.
    assert_eq!((number(&bytes, table + 12), number(&bytes, table + 16)), (1, FRAMES as u32));
    let duration = number(&bytes, table + 20);
    let runs: Vec<u8> = [2, 15, duration, 15, 2 * duration].iter().flat_map(|v: &u32| v.to_be_bytes()).collect();
    bytes.splice(table + 12..table + 24, runs);
    // The edit list shows the track from a place on and so long: one and a half times as long now.
    let edits = find_box(&bytes, &[b"moov", b"trak", b"edts", b"elst"]);
    let shown = number(&bytes, edits + 16) * 3 / 2;
    bytes[edits + 16..edits + 20].copy_from_slice(&shown.to_be_bytes());
    for depth in 1..=names.len() {
        let at = find_box(&bytes, &names[..depth]);
        let size = number(&bytes, at) + 8;
        bytes[at..at + 4].copy_from_slice(&size.to_be_bytes());
    }
    fs::write(&path, bytes).unwrap();
    let times: Vec<f64> = read(&path).unwrap().iter().map(|frame| frame.time_s).collect();
    println!("{times:.3?}");
    assert_eq!(times.len(), FRAMES);
    assert!(times.windows(2).all(|pair| pair[0] < pair[1]));
    let last = (15.0 + 2.0 * 14.0) / 30.0;
    assert!((times[FRAMES - 1] - last).abs() < 0.1, "{}", times[FRAMES - 1]);
}

#[test]
fn what_is_no_film_is_refused_by_name_with_the_remedy() {
    let (folder, path) = place("film.mp4");
    let is_refused = |path: &Path, words: &[&str]| {
        let fault = read(path).unwrap_err().to_string();
        let name = path.file_name().unwrap().to_string_lossy();
        for word in words.iter().chain([&name.as_ref()]) {
            assert!(fault.contains(word), "{fault} lacks {word}");
        }
        assert!(fault.lines().count() == 1, "{fault}");
    };
    is_refused(&path, &["No such file", "check the path"]);
    is_refused(folder.path(), &["is no file"]);
    fs::write(&path, "").unwrap();
    is_refused(&path, &["is empty", "copy it again"]);
    fs::write(&path, "These are not the frames you are looking for.\n".repeat(100)).unwrap();
    is_refused(&path, &["is no film", "convert"]);
    write(&path, 30.0);
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() * 2 / 3]).unwrap();
    is_refused(&path, &["cut off", "copy it again"]);
    // A stream of frames without an index at its end is readable up to the cut, which is told after the last frame.
    let path = folder.path().join("film.avi");
    write(&path, 30.0);
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let film = FilmReader::open(&path, &ReadOptions::default()).unwrap();
    let frames: Vec<_> = film.collect();
    let good = frames.iter().filter(|frame| frame.is_ok()).count();
    let fault = frames.last().unwrap().as_ref().unwrap_err().to_string();
    assert!((8..20).contains(&good) && good + 1 == frames.len(), "{good} of {}", frames.len());
    assert!(fault.contains("film.avi") && fault.contains("of 30 frames"), "{fault}");
}

#[test]
fn a_film_that_cannot_be_written_leaves_nothing() {
    let (folder, path) = place("film.mp4");
    let options = WriteOptions::default();
    let create = |name: &str, size, options: &WriteOptions| {
        FilmWriter::create(&folder.path().join(name), size, options).map(drop).unwrap_err().to_string()
    };
    assert!(create("film.gif", SIZE, &options).contains(".mp4"));
    assert!(create("film.mp4", [161, 96], &options).contains("even"));
    assert!(create("film.mp4", SIZE, &WriteOptions { fps: f64::NAN, ..options }).contains("1000"));
    assert!(create("nowhere/film.mp4", SIZE, &options).contains("film.mp4"));
    let mut film = FilmWriter::create(&path, SIZE, &options).unwrap();
    film.push(&counted(0)).unwrap();
    assert!(film.push(&Image::filled(4, 4, [0; 3])).unwrap_err().to_string().contains("frame 1"));
    drop(film);
    let film = FilmWriter::create(&path, SIZE, &options).unwrap();
    assert!(film.finish().unwrap_err().to_string().contains("without frames"));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}
