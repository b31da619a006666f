//! Pictures and films on disk: PNG and animated PNG.
//!
//! A file appears whole or not at all: it is written beside its name, flushed, then renamed.

use crate::RenderError;
use capture::Image;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Frame rates an animated PNG can hold: its delays are fractions of two 16-bit numbers.
const FPS: std::ops::RangeInclusive<f64> = 0.02..=650.0;

/// Writes an RGBA picture, 8 bit encoded sRGB, not premultiplied, as `.png`.
///
/// # Errors
/// [`RenderError::Format`] for another extension, [`RenderError::Invalid`] for a picture without
/// pixels, [`RenderError::Io`] where the file cannot be written.
pub fn write_png(path: &Path, image: &Image<[u8; 4]>) -> Result<(), RenderError> {
    check_extension(path, "a picture", &["png"], ".png")?;
    let (width, height) = png_size(path, image)?;
    write_whole(path, |file| {
        let mut writer = encoder(file, width, height).write_header()?;
        writer.write_image_data(image.pixels().as_flattened())?;
        writer.finish()
    })
}

/// Writes RGBA frames of one size as an animated PNG (`.png` or `.apng`) that repeats for ever, `fps`
/// frames a second. Frames are asked for one at a time; only one is in memory.
///
/// # Errors
/// [`RenderError::Format`] for another extension, [`RenderError::Invalid`] without frames, for frames
/// of different sizes, or a rate outside 0.02..=650, [`RenderError::Io`] where the file cannot be written.
pub fn write_film<F>(path: &Path, frames: F, fps: f64) -> Result<(), RenderError>
where
    F: IntoIterator<Item = Image<[u8; 4]>>,
    F::IntoIter: ExactSizeIterator,
{
    check_extension(path, "a film", &["png", "apng"], ".png or .apng (an animated PNG)")?;
    if !FPS.contains(&fps) {
        return Err(invalid(path, format!("{fps} frames a second"), "ask for 0.02 to 650"));
    }
    let mut frames = frames.into_iter();
    // The header counts the frames, so they must be known beforehand.
    let count = u32::try_from(frames.len()).unwrap_or(u32::MAX);
    let Some(first) = frames.next() else {
        return Err(invalid(path, "a film without frames".into(), "render at least one"));
    };
    let size = png_size(path, &first)?;
    let mut written = 1;
    write_whole(path, |file| {
        let mut encoder = encoder(file, size.0, size.1);
        encoder.set_animated(count, 0)?;
        let (numerator, denominator) = delay(fps);
        encoder.set_frame_delay(numerator, denominator)?;
        // Each frame replaces the last one: a transparent pixel shows what is behind the film.
        encoder.set_blend_op(png::BlendOp::Source)?;
        let mut writer = encoder.write_header()?;
        writer.write_image_data(first.pixels().as_flattened())?;
        for frame in frames.by_ref() {
            if (frame.width(), frame.height()) != (first.width(), first.height()) {
                return Err(png::EncodingError::from(std::io::Error::other(format!(
                    "frame {written} is {} × {}, the first one {} × {}; give all frames one size",
                    frame.width(),
                    frame.height(),
                    first.width(),
                    first.height(),
                ))));
            }
            writer.write_image_data(frame.pixels().as_flattened())?;
            written += 1;
        }
        writer.finish()
    })
}

/// Seconds a frame stands, as a fraction.
fn delay(fps: f64) -> (u16, u16) {
    // The largest numerator for which both parts fit.
    let numerator = [1000.0, 100.0, 1.0].into_iter().find(|n| n * fps <= f64::from(u16::MAX)).unwrap_or(1.0);
    (numerator as u16, (numerator * fps).round().max(1.0) as u16)
}

fn invalid(path: &Path, fault: String, remedy: &str) -> RenderError {
    RenderError::Invalid { path: path.into(), fault, remedy: remedy.into() }
}

fn check_extension(
    path: &Path,
    what: &'static str,
    known: &[&str],
    supported: &'static str,
) -> Result<(), RenderError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if known.contains(&extension.as_str()) {
        return Ok(());
    }
    Err(RenderError::Format { path: path.into(), what, supported })
}

fn png_size(path: &Path, image: &Image<[u8; 4]>) -> Result<(u32, u32), RenderError> {
    match (u32::try_from(image.width()), u32::try_from(image.height())) {
        (Ok(width), Ok(height)) if width > 0 && height > 0 => Ok((width, height)),
        _ => {
            let fault = format!("a picture of {} × {} pixels", image.width(), image.height());
            Err(invalid(path, fault, "render at a size above zero that PNG can hold"))
        }
    }
}

fn encoder<W: Write>(to: W, width: u32, height: u32) -> png::Encoder<'static, W> {
    let mut encoder = png::Encoder::new(to, width, height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder
}

/// Writes beside `path`, flushes, renames.
fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&std::fs::File>) -> Result<(), png::EncodingError>,
) -> Result<(), RenderError> {
    let io = |source: std::io::Error| RenderError::Io { path: path.into(), source };
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let file = builder().tempfile_in(folder).map_err(io)?;
    let mut buffer = BufWriter::new(file.as_file());
    write(&mut buffer).map_err(|fault| match fault {
        png::EncodingError::IoError(source) => io(source),
        other => io(std::io::Error::other(other)),
    })?;
    buffer.flush().map_err(io)?;
    drop(buffer);
    file.as_file().sync_all().map_err(io)?;
    file.persist(path).map_err(|fault| io(fault.error))?;
    Ok(())
}

/// Temporary files are private by default; what we leave behind follows the user's umask.
fn builder() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".turnlight-");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(value: u8) -> Image<[u8; 4]> {
        let mut image = Image::filled(5, 3, [value, 20, 30, 255]);
        image.set(1, 2, [0, 0, 0, 0]);
        image
    }

    #[test]
    fn a_picture_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.PNG");
        write_png(&path, &picture(9)).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(std::fs::read(&path).unwrap())).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, picture(9).pixels().as_flattened());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_film_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.apng");
        write_film(&path, (0..4).map(picture), 25.0).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(std::fs::read(&path).unwrap())).read_info().unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_frames, 4);
        for i in 0..4 {
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut pixels).unwrap();
            assert_eq!(pixels, picture(i).pixels().as_flattened());
        }
        assert_eq!(reader.info().frame_control().unwrap().delay_den, 25_000);
    }

    #[test]
    fn faults_leave_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let message = write_film(&path("a.mp4"), [picture(1)], 25.0).unwrap_err().to_string();
        assert!(message.contains(".apng") && message.contains("a.mp4"), "{message}");
        assert!(write_png(&path("a.jpg"), &picture(1)).is_err());
        assert!(write_png(&path("a.png"), &Image::filled(0, 4, [0; 4])).is_err());
        assert!(write_film(&path("a.png"), Vec::new(), 25.0).is_err());
        for fps in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(write_film(&path("a.png"), [picture(1)], fps).is_err());
        }
        let sizes = write_film(&path("a.png"), [picture(1), Image::filled(2, 2, [0; 4])], 25.0).unwrap_err();
        assert!(sizes.to_string().contains("one size"), "{sizes}");
        assert!(write_png(&path("no/such/a.png"), &picture(1)).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn delays_are_close() {
        for fps in [0.02, 1.0, 23.976, 25.0, 59.94, 120.0, 650.0] {
            let (numerator, denominator) = delay(fps);
            let actual = f64::from(denominator) / f64::from(numerator);
            assert!((actual / fps - 1.0).abs() < 0.01, "{fps} became {actual}");
        }
    }
}
