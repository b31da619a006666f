//! What cameras note of their lens beside a photograph (CIPA DC-008, Exif 2.32): TIFF directories of numbered entries.

/// Tags: of the directory of the camera's notes, and in it.
const CAMERA: u16 = 0x8769;
const FOCAL_MM: u16 = 0x920a;
const WIDTH: u16 = 0xa002;
const HEIGHT: u16 = 0xa003;
const PIXELS_PER_UNIT: u16 = 0xa20e;
const UNIT: u16 = 0xa210;
const FOCAL_IN_35_MM: u16 = 0xa405;
/// Diagonal of a frame of 35 mm film, 36 × 24, in millimetres: what lenses are called by is held against it.
const FILM_DIAGONAL: f64 = 43.267;
/// Focal lengths of cameras, in diagonals of the picture; others are slips.
const PLAUSIBLE: std::ops::RangeInclusive<f64> = 0.2..=20.0;

/// The focal length in pixels of a picture of this size, from its notes: from the length that gives the same picture on 35
/// mm film, or from the length in millimetres and the pixels a millimetre. As good as makers round it, about a tenth.
/// `None` where nothing of the kind is noted.
pub(crate) fn focal_px(notes: &[u8], [width, height]: [usize; 2]) -> Option<f64> {
    let tiff = Tiff::new(notes)?;
    let camera = tiff.number(tiff.first()?, CAMERA)? as usize;
    let number = |tag| tiff.number(camera, tag).filter(|v| *v > 0.0);
    let diagonal = (width as f64).hypot(height as f64);
    let by_film = || Some(number(FOCAL_IN_35_MM)? / FILM_DIAGONAL * diagonal);
    let by_sensor = || {
        let unit_mm = match number(UNIT).unwrap_or(2.0) as u32 {
            3 => 10.0,
            4 => 1.0,
            5 => 1e-3,
            _ => 25.4,
        };
        // Pixels of the sensor are not those of a picture made smaller.
        let taken = number(WIDTH).zip(number(HEIGHT)).map_or(diagonal, |(w, h)| w.hypot(h));
        Some(number(FOCAL_MM)? * number(PIXELS_PER_UNIT)? / unit_mm * diagonal / taken)
    };
    by_film().or_else(by_sensor).filter(|focal| PLAUSIBLE.contains(&(focal / diagonal)))
}

/// Directories of numbers. Whatever lies beyond the bytes is not there.
struct Tiff<'a> {
    bytes: &'a [u8],
    is_little: bool,
}

impl<'a> Tiff<'a> {
    fn new(bytes: &'a [u8]) -> Option<Self> {
        let is_little = match bytes.get(..4)? {
            b"II\x2a\0" => true,
            b"MM\0\x2a" => false,
            _ => return None,
        };
        Some(Self { bytes, is_little })
    }

    fn first(&self) -> Option<usize> {
        Some(self.word(4)? as usize)
    }

    fn half(&self, at: usize) -> Option<u16> {
        let bytes = self.bytes.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if self.is_little { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
    }

    fn word(&self, at: usize) -> Option<u32> {
        let bytes = self.bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if self.is_little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    /// The first number of an entry: 16 bits, 32 bits, or a fraction.
    fn number(&self, directory: usize, tag: u16) -> Option<f64> {
        let entries = usize::from(self.half(directory)?);
        let at = (0..entries).map(|i| directory + 2 + 12 * i).find(|&at| self.half(at) == Some(tag))?;
        match self.half(at + 2)? {
            3 => self.half(at + 8).map(f64::from),
            4 => self.word(at + 8).map(f64::from),
            5 => {
                let place = self.word(at + 8)? as usize;
                let (over, under) = (self.word(place)?, self.word(place.checked_add(4)?)?);
                (under != 0).then(|| f64::from(over) / f64::from(under))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Notes in big-endian order with these entries of whole numbers (16 bits) and fractions.
    pub(crate) fn notes(whole: &[(u16, u16)], fractions: &[(u16, [u32; 2])]) -> Vec<u8> {
        let mut bytes = b"MM\0\x2a\0\0\0\x08\0\x01\x87\x69\0\x04\0\0\0\x01\0\0\0\x1a\0\0\0\0".to_vec();
        let entries = whole.len() + fractions.len();
        bytes.extend((entries as u16).to_be_bytes());
        for (tag, value) in whole {
            bytes.extend([tag.to_be_bytes(), [0, 3], [0, 0], [0, 1], value.to_be_bytes(), [0, 0]].concat());
        }
        let rest = bytes.len() + 12 * fractions.len() + 4;
        for (i, (tag, _)) in fractions.iter().enumerate() {
            bytes.extend([tag.to_be_bytes(), [0, 5], [0, 0], [0, 1]].concat());
            bytes.extend(((rest + 8 * i) as u32).to_be_bytes());
        }
        bytes.extend([0; 4]);
        fractions.iter().flat_map(|(_, parts)| parts).for_each(|part| bytes.extend(part.to_be_bytes()));
        bytes
    }

    #[test]
    fn the_length_on_film_is_held_against_its_diagonal() {
        let focal = focal_px(&notes(&[(FOCAL_IN_35_MM, 28)], &[]), [4000, 3000]).unwrap();
        assert!((focal - 28.0 / 43.267 * 5000.0).abs() < 1e-6, "{focal}");
    }

    #[test]
    fn the_length_in_millimetres_needs_the_size_of_a_pixel() {
        // 50 mm, 4000 pixels on 36 mm: 111.1 a millimetre, the unit centimetres; the picture made smaller by two.
        let fractions = [(FOCAL_MM, [500, 10]), (PIXELS_PER_UNIT, [40_000, 36])];
        let whole = [(UNIT, 3), (WIDTH, 4000), (HEIGHT, 3000)];
        let focal = focal_px(&notes(&whole, &fractions), [2000, 1500]).unwrap();
        assert!((focal - 0.5 * 50.0 * 4000.0 / 36.0).abs() < 1e-6, "{focal}");
        assert_eq!(focal_px(&notes(&whole, &fractions[..1]), [2000, 1500]), None);
    }

    #[test]
    fn notes_that_lie_say_nothing() {
        let sound = notes(&[(FOCAL_IN_35_MM, 28)], &[(FOCAL_MM, [4, 0])]);
        (0..sound.len() - 20).for_each(|end| assert!(focal_px(&sound[..end], [40, 30]).is_none_or(f64::is_finite)));
        assert_eq!(focal_px(&notes(&[(FOCAL_IN_35_MM, 0)], &[(FOCAL_MM, [4, 0])]), [40, 30]), None);
        assert_eq!(focal_px(&notes(&[(FOCAL_IN_35_MM, 60_000)], &[]), [40, 30]), None);
        assert_eq!(focal_px(b"II\x2a\0\xff\xff\xff\xff", [40, 30]), None);
    }
}
