//! The books as they are stored: unused items dropped, numbers brought to few bits, indices to as many as they need.
//!
//! | part | an item | index bits | numbers, compact | full |
//! |---|---|---|---|---|
//! | P1 | `n_β` values of mean 1 | – | 8 bits of the row's largest | f32 |
//! | P2, P3, P4, P6 | `n_α`, `n_θ`, `n_φ`, 1 entries | `⌈log₂ S⌉` of the book below | scale, 6 bits, logarithmic | f32 |
//! | M | one of P2, one of I2 | `⌈log₂ S₂⌉ + ⌈log₂ S_I2⌉` | – | – |
//! | I2, I1 | `n_α`, `n_β` entries | `⌈log₂ S⌉` | – | – |
//! | C | Cr, Cb; u', v' | – | 16 bits each; 8 | f32 |
//!
//! Scales of range `R = c_max/c_min` are off by at most `ln R / 124` of themselves; code 0 is 0; a book whose
//! scales are all equal stores one. From below upward each scale takes over what rounding did to its child,
//! `⟨before, after⟩/⟨after, after⟩`. A single child needs no index, a single item of P4 no P6.

use super::color::{Color, log_luv_code, log_luv_value};
use super::grid::{Axis, Grid};
use super::grow::{Growing, Link};
use crate::btf::Precision;
use crate::btf::container::{Fault, Reader, Writer};

/// Bits of a scale, logarithmic.
const SCALE_BITS: u32 = 6;
/// Codes of a scale that are not 0, less one.
const SCALE_STEPS: f32 = ((1 << SCALE_BITS) - 2) as f32;
/// Scales are not told apart below this share of the largest.
const SCALE_RANGE: f32 = 4096.0;
/// Scales this near are one, for steps between them would be rounding.
const SAME: f32 = 1e-5;
/// Largest number a file may hold: products of four stay finite.
const LARGEST: f32 = 1e6;
/// Set beside the axis where colours are LogLuv; their range follows.
const LOG_LUV: u8 = 2;
/// Largest range of luminance a file may hold; [`to_coded_range`](crate::btf::to_coded_range) goes to 10⁷.
const LARGEST_RANGE: f32 = 1e12;

/// The books that materials share.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Books {
    pub(super) grid: Grid,
    pub(super) precision: Precision,
    pub(super) color: Color,
    /// P1.
    pub(super) rows: Vec<f32>,
    /// P2.
    pub(super) slices: Book,
    /// C, I1, I2.
    pub(super) colors: Vec<[f32; 2]>,
    pub(super) color_rows: Vec<u32>,
    pub(super) color_slices: Vec<u32>,
    /// M.
    pub(super) pairs: Vec<[u32; 2]>,
    /// P3, P4.
    pub(super) views: Book,
    pub(super) texels: Book,
}

/// Entries and how their scales are stored.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Book {
    pub(super) links: Vec<Link>,
    scales: Scales,
}

/// P6: the texels of one material at one size; a single link stands for all.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plane {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) book: Book,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Scales {
    Equal(f32),
    /// From, to.
    Logarithmic([f32; 2]),
    Full,
}

/// `⟨before, after⟩` and `⟨after, after⟩` of an item that was rounded.
type Moments = [f64; 2];

/// Which items of a book are used, and their new positions.
struct Kept {
    items: Vec<usize>,
    positions: Vec<u32>,
}

impl Kept {
    fn of(children: impl Iterator<Item = u32>, count: usize) -> Self {
        let mut used = vec![false; count];
        children.for_each(|child| used[child as usize] = true);
        let items: Vec<usize> = (0..count).filter(|&i| used[i]).collect();
        let mut positions = vec![0; count];
        items.iter().enumerate().for_each(|(new, &old)| positions[old] = new as u32);
        Self { items, positions }
    }

    /// The used items of a book of `width` entries.
    fn entries<'a, T: Copy>(&'a self, all: &'a [T], width: usize) -> impl Iterator<Item = T> + 'a {
        self.items.iter().flat_map(move |&i| all[i * width..][..width].iter().copied())
    }

    fn renumber(&self, link: Link) -> Link {
        Link { child: self.positions[link.child as usize], ..link }
    }
}

/// The books in their stored form, and the planes that use them.
pub(super) fn settle(
    growing: &Growing,
    planes: &[(usize, usize, Vec<Link>)],
    color: Color,
    precision: Precision,
) -> (Books, Vec<Plane>) {
    let (grid, lengths) = (growing.grid, color.lengths());
    let texels = Kept::of(planes.iter().flat_map(|p| &p.2).map(|l| l.child), growing.texel_count());
    let texel_links: Vec<Link> = texels.entries(&growing.texels, grid.phi).collect();
    let views = Kept::of(texel_links.iter().map(|l| l.child), growing.views.len() / grid.theta);
    let view_links: Vec<Link> = views.entries(&growing.views, grid.theta).collect();
    let pairs = Kept::of(view_links.iter().map(|l| l.child), growing.pairs.len());
    let used_pairs = || pairs.entries(&growing.pairs, 1);
    let slices = Kept::of(used_pairs().map(|p| p[0]), growing.slices.len() / grid.alpha);
    let slice_links: Vec<Link> = slices.entries(&growing.slices, grid.alpha).collect();
    let rows = Kept::of(slice_links.iter().map(|l| l.child), growing.rows.len());
    let color_slices = Kept::of(used_pairs().map(|p| p[1]), growing.color_slices.len() / grid.alpha);
    let color_links: Vec<u32> = color_slices.entries(&growing.color_slices, grid.alpha).collect();
    let color_rows = Kept::of(color_links.iter().copied(), growing.color_rows.len() / grid.beta);
    let row_links: Vec<u32> = color_rows.entries(&growing.color_rows, grid.beta).collect();
    let colors = Kept::of(row_links.iter().copied(), growing.colors.len());

    let (row_values, row_moments) = snap_rows(growing, &rows, precision);
    let renumbered = |links: &[Link], kept: &Kept| links.iter().map(|&l| kept.renumber(l)).collect::<Vec<_>>();
    let (slice_book, slice_moments) = snap(&renumbered(&slice_links, &rows), Some(grid.alpha), &row_moments, precision);
    let pair_moments: Vec<Moments> =
        used_pairs().map(|p| slice_moments[slices.positions[p[0] as usize] as usize]).collect();
    let (view_book, view_moments) = snap(&renumbered(&view_links, &pairs), Some(grid.theta), &pair_moments, precision);
    let (texel_book, texel_moments) = snap(&renumbered(&texel_links, &views), Some(grid.phi), &view_moments, precision);
    let items = texel_book.links.len() / grid.phi;
    let plane = |(width, height, links): &(usize, usize, Vec<Link>)| {
        // Up to here luminance had the length it adds to RGB.
        let absolute = |l: &Link| Link { child: l.child, scale: l.scale / lengths[0] };
        let links: Vec<Link> = renumbered(links, &texels).iter().map(absolute).collect();
        let (mut book, _) = snap(&links, None, &texel_moments, precision);
        // One stands for all where they take no bits, which is how they are read.
        if index_bits(items) + book.scales.bits() == 0 {
            book.links.truncate(1);
        }
        Plane { width: *width, height: *height, book }
    };
    let books = Books {
        grid,
        precision,
        color,
        rows: row_values,
        slices: slice_book,
        colors: colors.items.iter().map(|&c| snap_color(growing.colors.vector(c), color, precision)).collect(),
        color_rows: row_links.iter().map(|&c| colors.positions[c as usize]).collect(),
        color_slices: color_links.iter().map(|&r| color_rows.positions[r as usize]).collect(),
        pairs: used_pairs().map(|p| [slices.positions[p[0] as usize], color_slices.positions[p[1] as usize]]).collect(),
        views: view_book,
        texels: texel_book,
    };
    (books, planes.iter().map(plane).collect())
}

/// P1 in its normal form, rounded.
fn snap_rows(growing: &Growing, kept: &Kept, precision: Precision) -> (Vec<f32>, Vec<Moments>) {
    let (mut values, mut moments) = (Vec::new(), Vec::new());
    for &row in &kept.items {
        let before = with_mean_1(growing.rows.vector(row).to_vec());
        let after = match precision {
            Precision::Full => before.clone(),
            Precision::Compact => with_mean_1(row_codes(&before).map(f32::from).collect()),
        };
        moments.push([inner(&before, &after), inner(&after, &after)]);
        values.extend(after);
    }
    (values, moments)
}

/// A row in 8 bits of its largest value.
fn row_codes(row: &[f32]) -> impl Iterator<Item = u8> + '_ {
    let largest = row.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    row.iter().map(move |v| (255.0 * v / largest).round() as u8)
}

fn with_mean_1(mut row: Vec<f32>) -> Vec<f32> {
    let mean = row.iter().sum::<f32>() / row.len() as f32;
    row.iter_mut().for_each(|v| *v = if mean > 0.0 { *v / mean } else { 1.0 });
    row
}

fn inner(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(x, y)| f64::from(*x) * f64::from(*y)).sum()
}

fn snap_color(whitened: &[f32], color: Color, precision: Precision) -> [f32; 2] {
    let [_, first, second] = color.lengths();
    let chroma = [whitened[0] / first, whitened[1] / second];
    match (precision, color) {
        (Precision::Full, _) => chroma,
        (Precision::Compact, Color::YCrCb) => chroma.map(|c| color_value(color_code(c))),
        (Precision::Compact, Color::LogLuv { .. }) => chroma.map(|c| log_luv_value(log_luv_code(c))),
    }
}

fn color_code(color: f32) -> i16 {
    (color.clamp(-1.0, 1.0) * 32767.0).round() as i16
}

fn color_value(code: i16) -> f32 {
    f32::from(code.max(-32767)) / 32767.0
}

/// A book whose scales took over the rounding of its children, rounded itself. Equal scales take no bits, but for
/// items that nothing else would tell apart; those of P6 need not be.
fn snap(links: &[Link], width: Option<usize>, children: &[Moments], precision: Precision) -> (Book, Vec<Moments>) {
    let refit = |link: &Link| {
        let [cross, own] = children[link.child as usize];
        Link { child: link.child, scale: (f64::from(link.scale) * cross / own) as f32 }
    };
    let exact: Vec<Link> = links.iter().map(refit).collect();
    let told_apart = children.len() > 1 || links.len() == width.unwrap_or(links.len());
    let scales = Scales::of(&exact, told_apart, precision);
    let snapped: Vec<Link> =
        exact.iter().map(|l| Link { child: l.child, scale: scales.value(scales.code(l.scale)) }).collect();
    let moments =
        links.chunks_exact(width.unwrap_or(1)).zip(snapped.chunks_exact(width.unwrap_or(1))).map(|(before, after)| {
            let sums = before.iter().zip(after).fold([0.0; 2], |[cross, own], (b, a)| {
                let [child_cross, child_own] = children[b.child as usize];
                let (b, a) = (f64::from(b.scale), f64::from(a.scale));
                [cross + b * a * child_cross, own + a * a * child_own]
            });
            if sums[1] > 0.0 { sums } else { [1.0, 1.0] }
        });
    let moments = moments.collect();
    (Book { links: snapped, scales }, moments)
}

impl Scales {
    fn of(links: &[Link], told_apart: bool, precision: Precision) -> Self {
        let high = links.iter().map(|l| l.scale).fold(0.0, f32::max);
        let low = links.iter().map(|l| l.scale).filter(|s| *s > 0.0).fold(high, f32::min).max(high / SCALE_RANGE);
        let same = |scale: f32| high - scale <= SAME * high;
        let low = if same(low) { high } else { low };
        match precision {
            _ if told_apart && links.iter().all(|l| same(l.scale)) => Self::Equal(high),
            Precision::Compact => Self::Logarithmic([low, high]),
            Precision::Full => Self::Full,
        }
    }

    fn bits(self) -> u32 {
        match self {
            Self::Equal(_) => 0,
            Self::Logarithmic(_) => SCALE_BITS,
            Self::Full => 32,
        }
    }

    fn code(self, scale: f32) -> u32 {
        match self {
            Self::Equal(_) => 0,
            // Below half the smallest, 0 is nearer.
            Self::Logarithmic([low, _]) if scale < 0.5 * low => 0,
            Self::Logarithmic([low, high]) if high > low => {
                let step = SCALE_STEPS * (scale / low).ln() / (high / low).ln();
                1 + step.round().clamp(0.0, SCALE_STEPS) as u32
            }
            Self::Logarithmic(_) => 1,
            Self::Full => scale.to_bits(),
        }
    }

    fn value(self, code: u32) -> f32 {
        match self {
            Self::Equal(scale) => scale,
            Self::Logarithmic(_) if code == 0 => 0.0,
            Self::Logarithmic([low, high]) => low * (high / low).powf((code - 1) as f32 / SCALE_STEPS),
            Self::Full => f32::from_bits(code),
        }
    }

    fn write(self, out: &mut Writer) {
        out.u8(self.bits() as u8);
        match self {
            Self::Equal(scale) => out.f32(scale),
            Self::Logarithmic(range) => out.f32s(&range),
            Self::Full => {}
        }
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, Fault> {
        match u32::from(from.u8()?) {
            0 => Ok(Self::Equal(magnitude(from.f32()?)?)),
            SCALE_BITS => {
                let [low, high] = [magnitude(from.f32()?)?, magnitude(from.f32()?)?];
                let sound = low > 0.0 && low <= high && (high / low).is_finite();
                if sound {
                    Ok(Self::Logarithmic([low, high]))
                } else {
                    Err(Fault(format!("scales from {low} to {high}")))
                }
            }
            32 => Ok(Self::Full),
            other => Err(Fault(format!("scales of {other} bits"))),
        }
    }
}

fn magnitude(value: f32) -> Result<f32, Fault> {
    if (0.0..=LARGEST).contains(&value) { Ok(value) } else { Err(Fault(format!("{value} is no magnitude"))) }
}

/// Bits of a position among `count`.
pub(super) fn index_bits(count: usize) -> u32 {
    usize::BITS - count.saturating_sub(1).leading_zeros()
}

impl Book {
    fn write(&self, children: usize, out: &mut Writer) {
        self.scales.write(out);
        for link in &self.links {
            out.bits(link.child, index_bits(children));
            out.bits(self.scales.code(link.scale), self.scales.bits());
        }
        out.align();
    }

    /// `count` entries, or 1 that stands for all where they take no bits.
    fn read(count: usize, children: usize, from: &mut Reader<'_>) -> Result<Self, Fault> {
        let scales = Scales::read(from)?;
        let bits = index_bits(children) + scales.bits();
        let count = if bits == 0 { count.min(1) } else { count };
        expect_bits(count, bits, from)?;
        let link = |from: &mut Reader<'_>| {
            let child = position(children, from)?;
            let scale = scales.value(from.bits(scales.bits())?);
            Ok(Link { child, scale: magnitude(scale)? })
        };
        let links = (0..count).map(|_| link(from)).collect::<Result<_, Fault>>()?;
        from.align();
        Ok(Self { links, scales })
    }
}

fn expect_bits(count: usize, bits: u32, from: &Reader<'_>) -> Result<(), Fault> {
    from.expect(count.saturating_mul(bits as usize).div_ceil(8), 1)
}

fn position(count: usize, from: &mut Reader<'_>) -> Result<u32, Fault> {
    let at = from.bits(index_bits(count))?;
    if (at as usize) < count { Ok(at) } else { Err(Fault(format!("item {at} of {count}"))) }
}

/// How many items a book has: none is told apart by no bits.
fn count(bits_per_item: usize, from: &mut Reader<'_>) -> Result<usize, Fault> {
    let count = from.u32()? as usize;
    match (count, bits_per_item) {
        (0, _) => Err(Fault("a book is empty".into())),
        (2.., 0) => Err(Fault(format!("{count} items of no bits"))),
        _ => Ok(count),
    }
}

fn write_indices(all: &[u32], children: usize, out: &mut Writer) {
    all.iter().for_each(|&child| out.bits(child, index_bits(children)));
    out.align();
}

fn read_indices(width: usize, children: usize, from: &mut Reader<'_>) -> Result<Vec<u32>, Fault> {
    let entries = width * count(width * index_bits(children) as usize, from)?;
    expect_bits(entries, index_bits(children), from)?;
    // Entries of no bits are one item at most.
    let found = (0..entries).map(|_| position(children, from)).collect::<Result<_, _>>()?;
    from.align();
    Ok(found)
}

fn read_book(width: usize, children: usize, from: &mut Reader<'_>) -> Result<Book, Fault> {
    let items = from.u32()? as usize;
    let mut book = Book::read(items.saturating_mul(width), children, from)?;
    if book.links.is_empty() {
        return Err(Fault("a book is empty".into()));
    }
    if book.links.len() == 1 {
        book.links = vec![book.links[0]; width];
    }
    Ok(book)
}

impl Books {
    pub(super) fn write(&self, out: &mut Writer) {
        let grid = self.grid;
        out.part("grid");
        out.u8(u8::from(self.precision == Precision::Compact));
        [grid.alpha, grid.beta, grid.theta, grid.phi].iter().for_each(|&n| out.u8(n as u8));
        out.u8(grid.rim_deg);
        out.u8(u8::from(grid.axis == Axis::Along) | if self.color == Color::YCrCb { 0 } else { LOG_LUV });
        if let Color::LogLuv { range } = self.color {
            out.f32(range);
        }
        out.part("P1");
        out.u32((self.rows.len() / grid.beta) as u32);
        match self.precision {
            Precision::Full => out.f32s(&self.rows),
            Precision::Compact => {
                self.rows.chunks_exact(grid.beta).for_each(|row| row_codes(row).for_each(|code| out.u8(code)));
            }
        }
        out.part("P2");
        out.u32((self.slices.links.len() / grid.alpha) as u32);
        self.slices.write(self.rows.len() / grid.beta, out);
        self.write_colors(out);
        out.part("M");
        out.u32(self.pairs.len() as u32);
        for &[luma, color] in &self.pairs {
            out.bits(luma, index_bits(self.slices.links.len() / grid.alpha));
            out.bits(color, index_bits(self.color_slices.len() / grid.alpha));
        }
        out.align();
        out.part("P3");
        out.u32((self.views.links.len() / grid.theta) as u32);
        self.views.write(self.pairs.len(), out);
        out.part("P4");
        out.u32((self.texels.links.len() / grid.phi) as u32);
        self.texels.write(self.views.links.len() / grid.theta, out);
    }

    fn write_colors(&self, out: &mut Writer) {
        out.part("C");
        out.u32(self.colors.len() as u32);
        for value in self.colors.iter().flatten() {
            match (self.precision, self.color) {
                (Precision::Full, _) => out.f32(*value),
                (Precision::Compact, Color::YCrCb) => out.u16(color_code(*value) as u16),
                (Precision::Compact, Color::LogLuv { .. }) => out.u8(log_luv_code(*value)),
            }
        }
        out.part("I1");
        out.u32((self.color_rows.len() / self.grid.beta) as u32);
        write_indices(&self.color_rows, self.colors.len(), out);
        out.part("I2");
        out.u32((self.color_slices.len() / self.grid.alpha) as u32);
        write_indices(&self.color_slices, self.color_rows.len() / self.grid.beta, out);
    }

    pub(super) fn read(from: &mut Reader<'_>) -> Result<Self, Fault> {
        let precision = if from.u8()? == 0 { Precision::Full } else { Precision::Compact };
        let [alpha, beta, theta, phi] = [from.u8()?, from.u8()?, from.u8()?, from.u8()?].map(usize::from);
        if [alpha, beta, theta, phi].contains(&0) {
            return Err(Fault(format!("a grid of {alpha} × {beta} × {theta} × {phi}")));
        }
        let rim_deg = from.u8()?;
        if !(1..=90).contains(&rim_deg) {
            return Err(Fault(format!("views down to {rim_deg}°")));
        }
        let flags = from.u8()?;
        let axis = if flags & 1 == 0 { Axis::Perpendicular } else { Axis::Along };
        if flags & !(1 | LOG_LUV) != 0 {
            return Err(Fault(format!("flags {flags} are unknown; read it with a newer turnlight")));
        }
        let color = if flags & LOG_LUV == 0 { Color::YCrCb } else { read_log_luv(from)? };
        let grid = Grid { alpha, beta, theta, phi, rim_deg, axis };
        let rows = read_rows(beta, precision, from)?;
        let slices = read_book(alpha, rows.len() / beta, from)?;
        let colors = read_colors(precision, color, from)?;
        let color_rows = read_indices(beta, colors.len(), from)?;
        let color_slices = read_indices(alpha, color_rows.len() / beta, from)?;
        let pairs = read_pairs(slices.links.len() / alpha, color_slices.len() / alpha, from)?;
        let views = read_book(theta, pairs.len(), from)?;
        let texels = read_book(phi, views.links.len() / theta, from)?;
        Ok(Self { grid, precision, color, rows, slices, colors, color_rows, color_slices, pairs, views, texels })
    }
}

fn read_rows(beta: usize, precision: Precision, from: &mut Reader<'_>) -> Result<Vec<f32>, Fault> {
    let values = beta * count(beta, from)?;
    if precision == Precision::Compact {
        let codes = from.take(values)?.chunks_exact(beta);
        return Ok(codes.flat_map(|row| with_mean_1(row.iter().map(|&c| f32::from(c)).collect())).collect());
    }
    from.f32s(values)?.into_iter().map(magnitude).collect()
}

fn read_log_luv(from: &mut Reader<'_>) -> Result<Color, Fault> {
    let range = from.f32()?;
    let sound = (1.0..=LARGEST_RANGE).contains(&range);
    if sound { Ok(Color::LogLuv { range }) } else { Err(Fault(format!("a logarithm of luminance up to {range}"))) }
}

fn read_colors(precision: Precision, color: Color, from: &mut Reader<'_>) -> Result<Vec<[f32; 2]>, Fault> {
    let values = 2 * count(2, from)?;
    let flat = match (precision, color) {
        (Precision::Full, _) => from.f32s(values)?,
        (Precision::Compact, Color::LogLuv { .. }) => from.take(values)?.iter().map(|&c| log_luv_value(c)).collect(),
        (Precision::Compact, Color::YCrCb) => {
            from.u16s(values)?.into_iter().map(|code| color_value(code as i16)).collect()
        }
    };
    let color = |c: &[f32]| match c.iter().find(|c| c.abs() > LARGEST) {
        Some(bad) => Err(Fault(format!("a chroma of {bad}"))),
        None => Ok([c[0], c[1]]),
    };
    flat.chunks_exact(2).map(color).collect()
}

fn read_pairs(slices: usize, colors: usize, from: &mut Reader<'_>) -> Result<Vec<[u32; 2]>, Fault> {
    let bits = index_bits(slices) + index_bits(colors);
    let pairs = count(bits as usize, from)?;
    expect_bits(pairs, bits, from)?;
    let found = (0..pairs).map(|_| Ok([position(slices, from)?, position(colors, from)?])).collect::<Result<_, _>>();
    from.align();
    found
}

impl Plane {
    pub(super) fn write(&self, books: &Books, out: &mut Writer) {
        out.u16(self.width as u16);
        out.u16(self.height as u16);
        self.book.write(books.texels.links.len() / books.grid.phi, out);
    }

    pub(super) fn read(books: &Books, from: &mut Reader<'_>) -> Result<Self, Fault> {
        let (width, height) = (usize::from(from.u16()?), usize::from(from.u16()?));
        if width * height == 0 {
            return Err(Fault(format!("a plane of {width} × {height} texels")));
        }
        let book = Book::read(width * height, books.texels.links.len() / books.grid.phi, from)?;
        Ok(Self { width, height, book })
    }

    /// The item of P4 of a texel, and its scale.
    #[inline]
    pub(super) fn link(&self, texel: usize) -> Link {
        self.book.links[if self.book.links.len() == 1 { 0 } else { texel }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a range R, half of one of 62 steps: ln R / 124 of the scale.
    #[test]
    fn scales_are_off_by_no_more_than_their_range_says() {
        for range in [1.5_f32, 10.0, 100.0, 4000.0] {
            let links: Vec<Link> =
                (0..=5000).map(|i| Link { child: 0, scale: 0.03 * range.powf(i as f32 / 5000.0) }).collect();
            let scales = Scales::of(&links, true, Precision::Compact);
            let error = |l: &Link| (scales.value(scales.code(l.scale)) / l.scale).ln().abs();
            let (worst, bound) = (links.iter().map(error).fold(0.0, f32::max), range.ln() / 124.0);
            assert!(worst < bound * 1.001 + 1e-5 && worst > 0.95 * bound, "1 to {range}: {worst} {bound}");
        }
    }

    #[test]
    fn no_scale_is_exact_and_small_ones_stay() {
        let links = [0.0, 1e-3, 1.0].map(|scale| Link { child: 0, scale });
        let scales = Scales::of(&links, true, Precision::Compact);
        let back = links.map(|l| scales.value(scales.code(l.scale)));
        assert!(back[0] == 0.0 && (back[1] / 1e-3 - 1.0).abs() < 1e-4 && (back[2] - 1.0).abs() < 1e-6, "{back:?}");
    }
}
