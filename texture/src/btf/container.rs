//! The `.btfz` file: a material as its codec holds it, all numbers little-endian.
//!
//! ```text
//! 8   bytes  "\x89TLBTF\r\n"
//! u16        version, 2
//! u8         codec
//! u32        of everything before and after it, with zeros in its place: CRC-32
//! u8 n, n    name, UTF-8
//! u8         encoding: 0 sRGB, 1 linear, 2 log, then f32 floor, f32 peak
//! f32        exposure
//! u8         1 where the cosine of the light is in the samples
//! f32        texel pitch in mm, 0 where unknown
//! u64        raw bytes
//! u16, u16   width, height
//! lists      views, then lights: u16 n, then n × (f32 x, f32 y), z = √(1 − x² − y²); n = 0 stands for the 81 of Bonn
//! ...        the codec's own parts, to the end of the file
//! ```
//!
//! A size on disk is a size in memory times a small factor: counts are checked against the bytes that are
//! there before anything is allocated. Nothing is compressed further, so that codecs are compared by
//! what they hold.

use super::{Codec, CodecKind, DirectionSet, Frame, Material};
use capture::btf::{Btf, Encoding, bonn_directions};
use nalgebra::Vector3;
use std::fmt;
use std::sync::Arc;

const MAGIC: &[u8; 8] = b"\x89TLBTF\r\n";
const VERSION: u16 = 2;
/// Where the checksum stands.
const CHECKSUM_AT: usize = 11;
/// Largest tile of a file: some codecs keep nothing per texel, so that its bytes do not bound it.
const MAX_SIDE: usize = 1 << 14;
const MAX_TEXELS: usize = 1 << 22;
/// Most pairs of view and light, for the same reason.
const MAX_PAIRS: usize = 1 << 20;

/// What is wrong with a file's content.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault(pub String);

/// Bytes of one part of a file.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Part {
    /// What it holds.
    pub name: &'static str,
    /// How many.
    pub bytes: u64,
}

/// A codec that can be stored.
pub trait Stored: Sized {
    /// Appends all that is needed to decode, but for the frame.
    fn write(&self, out: &mut Writer);

    /// Reads what [`Stored::write`] wrote.
    ///
    /// # Errors
    /// Where counts, indices or numbers make no sense; nothing that passes may panic or answer NaN later.
    fn read(from: &mut Reader<'_>, frame: Frame) -> Result<Self, Fault>;
}

/// Bytes being written, by parts.
#[derive(Clone, Debug, Default)]
pub struct Writer {
    bytes: Vec<u8>,
    parts: Vec<(&'static str, usize)>,
    /// Bits not yet of a whole byte, lowest first.
    pending: (u64, u32),
}

/// Bytes being read.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    pending: (u64, u32),
}

impl Writer {
    /// What follows belongs to this part.
    pub fn part(&mut self, name: &'static str) {
        self.align();
        self.parts.push((name, self.bytes.len()));
    }

    /// The parts and their sizes.
    pub fn parts(&self) -> Vec<Part> {
        let ends = self.parts.iter().skip(1).map(|p| p.1).chain([self.bytes.len()]);
        self.parts.iter().zip(ends).map(|(&(name, start), end)| Part { name, bytes: (end - start) as u64 }).collect()
    }

    /// One byte.
    pub fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    /// Two bytes.
    pub fn u16(&mut self, value: u16) {
        self.bytes.extend(value.to_le_bytes());
    }

    /// Four bytes.
    pub fn u32(&mut self, value: u32) {
        self.bytes.extend(value.to_le_bytes());
    }

    /// Eight bytes.
    pub fn u64(&mut self, value: u64) {
        self.bytes.extend(value.to_le_bytes());
    }

    /// Four bytes.
    pub fn f32(&mut self, value: f32) {
        self.bytes.extend(value.to_le_bytes());
    }

    /// As they are.
    pub fn bytes(&mut self, values: &[u8]) {
        self.bytes.extend(values);
    }

    /// Four bytes each.
    pub fn f32s(&mut self, values: &[f32]) {
        values.iter().for_each(|&v| self.f32(v));
    }

    /// Two bytes each.
    pub fn u16s(&mut self, values: &[u16]) {
        values.iter().for_each(|&v| self.u16(v));
    }

    /// The lowest `width` (at most 32) bits, packed lowest first; [`Writer::align`] ends a run of them.
    pub fn bits(&mut self, value: u32, width: u32) {
        let (bits, held) = self.pending;
        let mask = if width == 0 { 0 } else { u64::MAX >> (64 - width) };
        self.pending = (bits | ((u64::from(value) & mask) << held), held + width);
        while self.pending.1 >= 8 {
            self.bytes.push(self.pending.0 as u8);
            self.pending = (self.pending.0 >> 8, self.pending.1 - 8);
        }
    }

    /// All that was written.
    pub fn into_bytes(mut self) -> Vec<u8> {
        self.align();
        self.bytes
    }

    /// Fills the last byte of a run of bits with zeros.
    pub fn align(&mut self) {
        if self.pending.1 > 0 {
            self.bytes.push(self.pending.0 as u8);
        }
        self.pending = (0, 0);
    }
}

impl<'a> Reader<'a> {
    /// Reads from the start.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, pending: (0, 0) }
    }

    /// Bytes left.
    pub fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next `count` bytes.
    ///
    /// # Errors
    /// Where fewer are left.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], Fault> {
        if count > self.left() {
            return Err(Fault(format!("{count} bytes are due at byte {}, {} are left", self.at, self.left())));
        }
        let taken = &self.bytes[self.at..self.at + count];
        self.at += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    /// One byte.
    ///
    /// # Errors
    /// At the end, as all below.
    pub fn u8(&mut self) -> Result<u8, Fault> {
        Ok(self.array::<1>()?[0])
    }

    /// Two bytes.
    ///
    /// # Errors
    /// At the end.
    pub fn u16(&mut self) -> Result<u16, Fault> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    /// Four bytes.
    ///
    /// # Errors
    /// At the end.
    pub fn u32(&mut self) -> Result<u32, Fault> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    /// Eight bytes.
    ///
    /// # Errors
    /// At the end.
    pub fn u64(&mut self) -> Result<u64, Fault> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    /// Four bytes, a finite number.
    ///
    /// # Errors
    /// At the end, and where it is infinite or no number.
    pub fn f32(&mut self) -> Result<f32, Fault> {
        let at = self.at;
        let value = f32::from_le_bytes(self.array()?);
        if value.is_finite() { Ok(value) } else { Err(Fault(format!("{value} stands at byte {at}"))) }
    }

    /// That many finite numbers.
    ///
    /// # Errors
    /// Where fewer are left, before anything is allocated, and where one is not finite.
    pub fn f32s(&mut self, count: usize) -> Result<Vec<f32>, Fault> {
        self.expect(count, 4)?;
        (0..count).map(|_| self.f32()).collect()
    }

    /// That many numbers of two bytes.
    ///
    /// # Errors
    /// Where fewer are left, before anything is allocated.
    pub fn u16s(&mut self, count: usize) -> Result<Vec<u16>, Fault> {
        self.expect(count, 2)?;
        (0..count).map(|_| self.u16()).collect()
    }

    /// The next `width` bits, packed as [`Writer::bits`] does.
    ///
    /// # Errors
    /// At the end.
    pub fn bits(&mut self, width: u32) -> Result<u32, Fault> {
        while self.pending.1 < width {
            let byte = u64::from(self.u8()?);
            self.pending = (self.pending.0 | (byte << self.pending.1), self.pending.1 + 8);
        }
        let mask = if width == 0 { 0 } else { u64::MAX >> (64 - width) };
        let value = (self.pending.0 & mask) as u32;
        self.pending = (self.pending.0 >> width, self.pending.1 - width);
        Ok(value)
    }

    /// Leaves what is left of the last byte of a run of bits.
    pub fn align(&mut self) {
        self.pending = (0, 0);
    }

    /// Checks that `count` items of `size` bytes are left.
    ///
    /// # Errors
    /// Where they are not.
    pub fn expect(&self, count: usize, size: usize) -> Result<(), Fault> {
        if count.checked_mul(size).is_some_and(|bytes| bytes <= self.left()) {
            return Ok(());
        }
        Err(Fault(format!("{count} items of {size} bytes are due at byte {}, {} bytes are left", self.at, self.left())))
    }
}

impl Material {
    /// The file, and what its parts take.
    pub fn to_bytes(&self) -> (Vec<u8>, Vec<Part>) {
        let mut out = Writer::default();
        out.part("header");
        out.bytes(MAGIC);
        out.u16(VERSION);
        out.u8(self.codec.kind() as u8);
        out.u32(0);
        write_header(self, self.codec.frame(), &mut out);
        self.codec.write(&mut out);
        out.align();
        let parts = out.parts();
        let checksum = checksum(&out.bytes);
        out.bytes[CHECKSUM_AT..CHECKSUM_AT + 4].copy_from_slice(&checksum.to_le_bytes());
        (out.bytes, parts)
    }

    /// Bytes of the file.
    pub fn byte_count(&self) -> u64 {
        self.to_bytes().0.len() as u64
    }

    /// Reads a file's content.
    ///
    /// # Errors
    /// Says what is wrong with it.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Fault> {
        let mut from = Reader::new(bytes);
        if from.take(MAGIC.len()).map_or(true, |magic| magic != MAGIC) {
            return Err(Fault("it is no .btfz file".into()));
        }
        let version = from.u16()?;
        if version != VERSION {
            return Err(Fault(format!("it is of version {version}, this program reads {VERSION}")));
        }
        let code = from.u8()?;
        let kind = CodecKind::ALL.iter().copied().find(|kind| *kind as u8 == code);
        let kind = kind.ok_or_else(|| Fault(format!("codec {code} is unknown")))?;
        if from.u32()? != checksum(bytes) {
            return Err(Fault("its checksum is wrong".into()));
        }
        let (header, frame) = read_header(&mut from)?;
        let codec = Codec::read(kind, &mut from, frame)?;
        from.align();
        if from.left() > 0 {
            return Err(Fault(format!("{} bytes follow its end", from.left())));
        }
        Ok(header(codec))
    }
}

/// Bytes of a file before the codec's own parts.
pub(super) fn header_bytes(btf: &Btf) -> usize {
    let mut out = Writer::default();
    [&btf.views, &btf.lights].into_iter().for_each(|list| write_directions(list, &mut out));
    let range = if matches!(btf.encoding, Encoding::Log { .. }) { 8 } else { 0 };
    // Fields of fixed size after the magic, then name, range and directions.
    MAGIC.len() + 30 + stored_name(&btf.name).len() + range + out.bytes.len()
}

/// As much of a name as a file holds.
pub(super) fn stored_name(name: &str) -> &str {
    let end = (0..=name.len().min(255)).rev().find(|&i| name.is_char_boundary(i)).unwrap_or(0);
    &name[..end]
}

/// Says what of a grid no file can hold.
pub(super) fn unstorable(width: usize, height: usize, views: usize, lights: usize) -> Option<String> {
    if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) || width * height > MAX_TEXELS {
        return Some(format!("a tile of {width} × {height} texels"));
    }
    let few = |count: usize| (1..=usize::from(u16::MAX)).contains(&count);
    let fits = few(views) && few(lights) && views * lights <= MAX_PAIRS;
    (!fits).then(|| format!("{views} views and {lights} lights"))
}

fn write_header(material: &Material, frame: &Frame, out: &mut Writer) {
    let name = stored_name(&material.name).as_bytes();
    out.u8(name.len() as u8);
    out.bytes(name);
    match material.encoding {
        Encoding::Srgb => out.u8(0),
        Encoding::Linear => out.u8(1),
        Encoding::Log { floor, peak } => {
            out.u8(2);
            out.f32s(&[floor, peak]);
        }
    }
    out.f32(material.exposure);
    out.u8(u8::from(material.includes_cosine));
    out.f32(material.texel_pitch_mm.unwrap_or(0.0));
    out.u64(material.raw_bytes);
    out.u16(frame.width as u16);
    out.u16(frame.height as u16);
    write_directions(frame.views.vectors(), out);
    write_directions(frame.lights.vectors(), out);
}

fn write_directions(directions: &[Vector3<f64>], out: &mut Writer) {
    if directions == bonn_directions() {
        return out.u16(0);
    }
    out.u16(directions.len() as u16);
    directions.iter().for_each(|d| out.f32s(&[d.x as f32, d.y as f32]));
}

pub(super) fn read_name(from: &mut Reader<'_>) -> Result<String, Fault> {
    let length = usize::from(from.u8()?);
    let name = std::str::from_utf8(from.take(length)?);
    name.map(str::to_owned).map_err(|fault| Fault(format!("its name is no UTF-8: {fault}")))
}

/// All but the codec.
fn read_header(from: &mut Reader<'_>) -> Result<(impl FnOnce(Codec) -> Material + use<>, Frame), Fault> {
    let name = read_name(from)?;
    let encoding = match from.u8()? {
        0 => Encoding::Srgb,
        1 => Encoding::Linear,
        2 => log_encoding(from.f32()?, from.f32()?)?,
        other => return Err(Fault(format!("encoding {other} is unknown"))),
    };
    let exposure = from.f32()?;
    if exposure <= 0.0 {
        return Err(Fault(format!("its exposure is {exposure}")));
    }
    let includes_cosine = from.u8()? != 0;
    let texel_pitch_mm = Some(from.f32()?).filter(|pitch| *pitch > 0.0);
    let raw_bytes = from.u64()?;
    let (width, height) = (usize::from(from.u16()?), usize::from(from.u16()?));
    let [views, lights] = [read_directions(from)?, read_directions(from)?];
    let is_shared = views == lights;
    let views = Arc::new(DirectionSet::new(&views));
    let lights = if is_shared { views.clone() } else { Arc::new(DirectionSet::new(&lights)) };
    if let Some(fault) = unstorable(width, height, views.len(), lights.len()) {
        return Err(Fault(fault));
    }
    let header = move |codec| Material { name, encoding, exposure, includes_cosine, texel_pitch_mm, raw_bytes, codec };
    Ok((header, Frame { width, height, views, lights }))
}

fn log_encoding(floor: f32, peak: f32) -> Result<Encoding, Fault> {
    if floor > 0.0 && peak >= floor && (peak / floor).is_finite() {
        return Ok(Encoding::Log { floor, peak });
    }
    Err(Fault(format!("its logarithm runs from {floor} to {peak}")))
}

fn read_directions(from: &mut Reader<'_>) -> Result<Vec<Vector3<f64>>, Fault> {
    let count = usize::from(from.u16()?);
    if count == 0 {
        return Ok(bonn_directions());
    }
    let flat = from.f32s(2 * count)?;
    let direction = |xy: &[f32]| {
        let (x, y) = (f64::from(xy[0]), f64::from(xy[1]));
        let rest = 1.0 - x * x - y * y;
        let unit = Vector3::new(x, y, rest.max(0.0).sqrt()).try_normalize(0.5);
        unit.filter(|_| rest > -1e-6).ok_or_else(|| Fault(format!("({x}, {y}) is no direction")))
    };
    flat.chunks_exact(2).map(direction).collect()
}

/// CRC-32 of a file's bytes, zeros in the place where it stands.
pub fn checksum(bytes: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    let (head, tail) = bytes.split_at(CHECKSUM_AT.min(bytes.len()));
    crc.update(head);
    crc.update(&[0; 4]);
    crc.update(tail.get(4..).unwrap_or(&[]));
    crc.sum()
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
