//! Stanford PLY, ASCII and binary little endian. UVs of vertices (`s t`, `u v`, `texture_u texture_v`)
//! and of faces (MeshLab's `texcoord`) are understood; other properties are skipped.

use super::{EXPORT_AGAIN, Fault, Parsed, fault};
use crate::mesh::Mesh;
use nalgebra::{Point2, Point3};
use std::fmt::Write as _;

#[derive(Clone, Copy, PartialEq)]
enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

struct Property {
    name: String,
    /// Of a list the type of its length.
    length: Option<Number>,
    number: Number,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Fault> {
    let (binary, elements, body) = header(bytes)?;
    let mut source = if binary { Source::Binary(body) } else { Source::ascii(body)? };
    let mut parsed = Parsed::default();
    let mut vertex_uvs = Vec::new();
    for element in &elements {
        for row in 0..element.count {
            let cut_off = || fault(format!("ends inside {} {row} of {}", element.name, element.count), EXPORT_AGAIN);
            let values = source.row(element).ok_or_else(cut_off)?;
            match element.name.as_str() {
                "vertex" => vertex(element, &values, &mut parsed, &mut vertex_uvs),
                "face" => face(element, &values, &mut parsed)
                    .ok_or_else(|| fault(format!("face {row} has an index that is not a vertex"), EXPORT_AGAIN))?,
                _ => {}
            }
        }
    }
    uvs_of_vertices(&mut parsed, &vertex_uvs);
    Ok(parsed)
}

/// Whether the body is binary, what it holds, and the body.
fn header(bytes: &[u8]) -> Result<(bool, Vec<Element>, &[u8]), Fault> {
    let mut rest = bytes;
    let mut binary = None;
    let mut elements: Vec<Element> = Vec::new();
    for number in 1.. {
        let end = rest.iter().position(|&b| b == b'\n');
        let end = end.ok_or_else(|| fault("the header does not end", "check that the file is a whole PLY file"))?;
        let line = String::from_utf8_lossy(&rest[..end]).into_owned();
        rest = &rest[end + 1..];
        let words: Vec<&str> = line.split_whitespace().collect();
        let refuse = || fault(format!("line {number}: `{}` is not understood", line.trim()), EXPORT_AGAIN);
        match words[..] {
            ["ply"] if number == 1 => {}
            _ if number == 1 => return Err(fault("does not begin with `ply`", "check that the file is a PLY file")),
            ["format", "ascii", _] => binary = Some(false),
            ["format", "binary_little_endian", _] => binary = Some(true),
            ["format", kind, _] => {
                return Err(fault(format!("is {kind}"), "export it as ascii or binary_little_endian"));
            }
            ["element", name, count] => elements.push(Element {
                name: name.to_owned(),
                count: count.parse().map_err(|_e| refuse())?,
                properties: Vec::new(),
            }),
            ["property", ref property @ ..] => {
                let property = parse_property(property).ok_or_else(refuse)?;
                elements.last_mut().ok_or_else(refuse)?.properties.push(property);
            }
            ["end_header"] => break,
            [] | ["comment" | "obj_info", ..] => {}
            _ => return Err(refuse()),
        }
    }
    let binary = binary.ok_or_else(|| fault("the header names no format", EXPORT_AGAIN))?;
    check_elements(&elements)?;
    Ok((binary, elements, rest))
}

/// Every row takes a byte at least, so that a count cannot outrun the file.
fn check_elements(elements: &[Element]) -> Result<(), Fault> {
    let has = |e: &Element, names: &[&str]| names.iter().all(|n| e.properties.iter().any(|p| p.name == *n));
    if elements.iter().any(|e| e.properties.is_empty() && e.count > 0) {
        return Err(fault("an element has no properties", EXPORT_AGAIN));
    }
    if !elements.iter().any(|e| e.name == "vertex" && has(e, &["x", "y", "z"])) {
        return Err(fault("has no vertices with x, y and z", EXPORT_AGAIN));
    }
    Ok(())
}

fn parse_property(words: &[&str]) -> Option<Property> {
    match *words {
        ["list", length, number, name] => Some(Property {
            name: name.to_owned(),
            length: Some(Number::parse(length)?),
            number: Number::parse(number)?,
        }),
        [number, name] => Some(Property { name: name.to_owned(), length: None, number: Number::parse(number)? }),
        _ => None,
    }
}

impl Number {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Takes one number off the front.
    fn take(self, bytes: &mut &[u8]) -> Option<f64> {
        fn first<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
            let (first, rest) = bytes.split_first_chunk()?;
            *bytes = rest;
            Some(*first)
        }
        Some(match self {
            Self::I8 => f64::from(i8::from_le_bytes(first(bytes)?)),
            Self::U8 => f64::from(u8::from_le_bytes(first(bytes)?)),
            Self::I16 => f64::from(i16::from_le_bytes(first(bytes)?)),
            Self::U16 => f64::from(u16::from_le_bytes(first(bytes)?)),
            Self::I32 => f64::from(i32::from_le_bytes(first(bytes)?)),
            Self::U32 => f64::from(u32::from_le_bytes(first(bytes)?)),
            Self::F32 => f64::from(f32::from_le_bytes(first(bytes)?)),
            Self::F64 => f64::from_le_bytes(first(bytes)?),
        })
    }
}

enum Source<'a> {
    Binary(&'a [u8]),
    Ascii(std::str::SplitAsciiWhitespace<'a>),
}

impl<'a> Source<'a> {
    fn ascii(body: &'a [u8]) -> Result<Self, Fault> {
        let text = std::str::from_utf8(body).map_err(|e| fault(format!("is not text: {e}"), EXPORT_AGAIN))?;
        Ok(Self::Ascii(text.split_ascii_whitespace()))
    }

    /// The values of one row, per property.
    fn row(&mut self, element: &Element) -> Option<Vec<Vec<f64>>> {
        element.properties.iter().map(|p| self.property(p)).collect()
    }

    fn property(&mut self, property: &Property) -> Option<Vec<f64>> {
        let length = property.length.map_or(Some(1.0), |length| self.number(length))?;
        // A length that is negative or not a number becomes 0, one too long runs into the end.
        (0..length as u64).map(|_| self.number(property.number)).collect()
    }

    fn number(&mut self, number: Number) -> Option<f64> {
        match self {
            Self::Binary(bytes) => number.take(bytes),
            Self::Ascii(words) => words.next()?.parse().ok(),
        }
    }
}

fn value(element: &Element, values: &[Vec<f64>], name: &str) -> Option<f64> {
    let place = element.properties.iter().position(|p| p.name == name)?;
    values[place].first().copied()
}

fn vertex(element: &Element, values: &[Vec<f64>], parsed: &mut Parsed, uvs: &mut Vec<Point2<f64>>) {
    let [x, y, z] = ["x", "y", "z"].map(|n| value(element, values, n).unwrap_or(f64::NAN));
    parsed.positions.push(Point3::new(x, y, z));
    for [u, v] in [["s", "t"], ["u", "v"], ["texture_u", "texture_v"]] {
        if let (Some(u), Some(v)) = (value(element, values, u), value(element, values, v)) {
            uvs.push(Point2::new(u, 1.0 - v));
            break;
        }
    }
}

/// Adds a polygon as a fan; `None` if an index is not a whole number in range of `u32`.
fn face(element: &Element, values: &[Vec<f64>], parsed: &mut Parsed) -> Option<()> {
    let list = |names: [&str; 2]| {
        let place = element.properties.iter().position(|p| p.length.is_some() && names.contains(&p.name.as_str()))?;
        Some(&values[place])
    };
    let corners = list(["vertex_indices", "vertex_index"])?;
    let corners: Option<Vec<u32>> = corners
        .iter()
        .map(|&v| (v >= 0.0 && v < f64::from(u32::MAX) && v.fract() == 0.0).then_some(v as u32))
        .collect();
    let corners = corners?;
    let uvs = list(["texcoord", "texcoords"]).filter(|uvs| uvs.len() == 2 * corners.len());
    for k in 1..corners.len().saturating_sub(1) {
        let fan = [0, k, k + 1];
        parsed.faces.push(fan.map(|i| corners[i]));
        if let Some(uvs) = uvs {
            parsed.corner_uvs.push(fan.map(|i| Point2::new(uvs[2 * i], 1.0 - uvs[2 * i + 1])));
        }
    }
    Some(())
}

fn uvs_of_vertices(parsed: &mut Parsed, uvs: &[Point2<f64>]) {
    if parsed.corner_uvs.is_empty() && !uvs.is_empty() && uvs.len() == parsed.positions.len() {
        let corner = |v: u32| uvs.get(v as usize).copied().unwrap_or_default();
        parsed.corner_uvs = parsed.faces.iter().map(|f| f.map(corner)).collect();
        parsed.split = true;
    }
}

/// Binary little endian, `double` coordinates.
pub(super) fn to_bytes(mesh: &Mesh, uvs: Option<&[Point2<f64>]>) -> Vec<u8> {
    let mut header = String::from("ply\nformat binary_little_endian 1.0\ncomment written by turnlight\n");
    let names = if uvs.is_some() { &["x", "y", "z", "s", "t"][..] } else { &["x", "y", "z"] };
    let _ = writeln!(header, "element vertex {}", mesh.positions.len());
    names.iter().for_each(|n| header += &format!("property double {n}\n"));
    let _ = writeln!(header, "element face {}\nproperty list uchar uint vertex_indices\nend_header", mesh.faces.len());
    let mut bytes = header.into_bytes();
    for (i, p) in mesh.positions.iter().enumerate() {
        p.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        if let Some(uv) = uvs.and_then(|uvs| uvs.get(i)) {
            [uv.x, 1.0 - uv.y].iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        }
    }
    for f in &mesh.faces {
        bytes.push(3);
        f.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    bytes
}
