//! Interpolation over view directions: a simplicial complex on the unit sphere.
//!
//! Sites are the directions in which a facet was photographed. A query direction is carried to the
//! nearest point of the complex and written as a convex combination of the corners of the simplex
//! it falls on: three sites inside a triangle, two on an edge, one at a corner. Weights are
//! continuous across simplices, a unit vector at a site, and never extrapolate.
//!
//! * *General layouts*: the triangles of the spherical Delaunay triangulation, found in the plane:
//!   stereographic projection maps circles to circles, so planar Delaunay of the projected sites is
//!   spherical Delaunay about them. Edges are the border, for queries outside.
//! * *A single ring* (a turntable): triangulating directions on one circle gives slivers between
//!   sites far apart, hence jumps. The complex is then the edges between neighbours in azimuth
//!   about the ring's axis, closed where the ring is closed, and a query is placed by its azimuth
//!   alone: no seam, and no jump for an eye above or below the ring, where the nearest point would jump.
//!
//! Source: Jagersand, Birkbeck, Cobzas, section 4 (the chart of the triangulation is not given
//! there). Cost: O(n log n) to build, O(triangles + edges) a query.

use nalgebra::{Matrix3, Vector3};
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::f64::consts::PI;

/// How the cameras of a capture lie about the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Layout {
    /// All on one circle about this unit axis.
    Ring(Vector3<f64>),
    /// Anything else.
    General,
}

/// Sites on the unit sphere and the simplices between them.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionComplex {
    sites: Vec<Vector3<f64>>,
    triangles: Vec<[u32; 3]>,
    edges: Vec<[u32; 2]>,
    /// The axis of a single ring.
    ring: Option<Vector3<f64>>,
    /// Rows give barycentric weights up to scale: the inverse of `[a b c]`.
    inverses: Vec<Matrix3<f64>>,
}

/// Simplices among which some direction finds its own, each list ascending.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Candidates {
    triangles: Vec<u32>,
    sites: Vec<u32>,
    edges: Vec<u32>,
}

/// A convex combination of up to three sites; unused entries have weight 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blend {
    /// Site and weight; weights are ≥ 0 and sum to 1.
    pub entries: [(u32, f64); 3],
}

/// A gap in a ring wider than this many median spacings is not interpolated across: nothing is
/// known there, and a cross-fade over it would show two wrong pictures at once.
const RING_GAP: f64 = 3.5;

/// Directions closer than this share of the median spacing play the same role and are merged:
/// barycentric weights would flip between their noisy copies.
const MERGE_SHARE: f64 = 0.2;

/// Cameras are a ring where they leave the plane through them by less than this share of their spacing.
const RING_FLATNESS: f64 = 0.5;

/// Sites whose stereographic image lies beyond this radius (directions within 16° of the antipode of
/// the mean) are left out of the triangulation and answer as isolated sites.
const STEREOGRAPHIC_REACH: f64 = 7.0;

struct PlaneSite {
    position: Point2<f64>,
    site: u32,
}

impl HasPosition for PlaneSite {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// Decides how unit `directions` lie about their origin. Fewer than five are never called a ring.
pub fn layout(directions: &[Vector3<f64>]) -> Layout {
    if directions.len() < 5 {
        return Layout::General;
    }
    let mean = directions.iter().sum::<Vector3<f64>>() / directions.len() as f64;
    let covariance: Matrix3<f64> = directions.iter().map(|d| (d - mean) * (d - mean).transpose()).sum();
    let Some(eigen) = covariance.try_symmetric_eigen(1e-15, 1000) else { return Layout::General };
    let smallest = eigen.eigenvalues.imin();
    let off_plane = (eigen.eigenvalues[smallest].max(0.0) / directions.len() as f64).sqrt();
    let axis: Vector3<f64> = eigen.eigenvectors.column(smallest).into();
    if off_plane < RING_FLATNESS * spacing(directions) { Layout::Ring(axis) } else { Layout::General }
}

/// Groups directions that are almost the same; each group lists positions in `directions`, ascending.
pub fn merge_directions(directions: &[Vector3<f64>]) -> Vec<Vec<usize>> {
    groups_within(directions, MERGE_SHARE * spacing(directions))
}

/// Each group holds what lies within `reach` of its first member and of that of no group before.
fn groups_within(directions: &[Vector3<f64>], reach: f64) -> Vec<Vec<usize>> {
    let reach = (2.0 * (0.5 * reach.min(PI)).sin()).powi(2);
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, d) in directions.iter().enumerate() {
        match groups.iter_mut().find(|g| squared_chord(d, &directions[g[0]]) <= reach) {
            Some(group) => group.push(i),
            None => groups.push(vec![i]),
        }
    }
    groups
}

/// The typical angle between neighbours, near-copies counted as one: the median spacing of what is left
/// once directions closer than [`MERGE_SHARE`] of it are merged. Found from above, because the median
/// over all of a turn filmed twice is the noise between its copies.
fn spacing(directions: &[Vector3<f64>]) -> f64 {
    let mut spacing = directions.iter().map(|d| angle(d, &directions[0])).fold(0.0, f64::max);
    while spacing > 0.0 {
        let groups = groups_within(directions, MERGE_SHARE * spacing);
        let distinct: Vec<Vector3<f64>> = groups.iter().map(|g| directions[g[0]]).collect();
        let finer = median_spacing(&distinct);
        if distinct.len() == directions.len() {
            return finer;
        }
        if finer >= spacing {
            break;
        }
        spacing = finer;
    }
    spacing
}

/// Median over directions of the angle to the nearest other one; 0 for fewer than two.
fn median_spacing(directions: &[Vector3<f64>]) -> f64 {
    let others = |i: usize| directions.iter().enumerate().filter(move |(j, _)| *j != i);
    let nearest = |i: usize| others(i).map(|(_, d)| squared_chord(d, &directions[i])).min_by(f64::total_cmp);
    let mut nearest: Vec<f64> = (0..directions.len()).filter_map(nearest).collect();
    nearest.sort_by(f64::total_cmp);
    nearest.get(nearest.len() / 2).map_or(0.0, |chord| 2.0 * (0.5 * chord.sqrt()).min(1.0).asin())
}

/// Orders unit vectors as their angle does, for a tenth of its cost.
fn squared_chord(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    (a - b).norm_squared()
}

/// The angle between unit vectors, accurate for small angles too.
pub(crate) fn angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b))
}

impl DirectionComplex {
    /// The complex over unit `sites`, which should be distinct ([`merge_directions`]).
    pub fn build(sites: &[Vector3<f64>], layout: Layout) -> Self {
        let (triangles, edges) = match layout {
            Layout::Ring(axis) => (Vec::new(), ring_edges(sites, &axis)),
            Layout::General => delaunay(sites),
        };
        Self::assemble(sites.to_vec(), triangles, edges, layout)
    }

    /// A complex as stored; `None` where an index points outside or a direction is not finite and unit.
    pub fn from_parts(
        sites: Vec<Vector3<f64>>,
        triangles: Vec<[u32; 3]>,
        edges: Vec<[u32; 2]>,
        layout: Layout,
    ) -> Option<Self> {
        let n = sites.len() as u32;
        let unit = |s: &Vector3<f64>| (s.norm() - 1.0).abs() < 1e-3;
        let sound = sites.iter().all(unit)
            && triangles.iter().flatten().chain(edges.iter().flatten()).all(|&i| i < n)
            && !matches!(layout, Layout::Ring(axis) if !unit(&axis));
        sound.then(|| Self::assemble(sites, triangles, edges, layout))
    }

    fn assemble(sites: Vec<Vector3<f64>>, triangles: Vec<[u32; 3]>, edges: Vec<[u32; 2]>, layout: Layout) -> Self {
        let ring = match layout {
            Layout::Ring(axis) => Some(axis),
            Layout::General => None,
        };
        let corner = |i: u32| sites[i as usize];
        let inverses = triangles
            .iter()
            .map(|t| {
                Matrix3::from_columns(&[corner(t[0]), corner(t[1]), corner(t[2])])
                    .try_inverse()
                    .unwrap_or_else(Matrix3::zeros)
            })
            .collect();
        Self { sites, triangles, edges, ring, inverses }
    }

    /// The directions.
    pub fn sites(&self) -> &[Vector3<f64>] {
        &self.sites
    }

    /// Triangles, as sites.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The axis of a single ring; `None` for any other layout.
    pub fn ring(&self) -> Option<Vector3<f64>> {
        self.ring
    }

    /// Edges that a query outside all triangles is carried to.
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// The weights of the sites for a query direction, which need not be unit. A direction of zero
    /// length or not finite gets the first site; `None` only of a complex without sites.
    pub fn blend(&self, query: &Vector3<f64>) -> Option<Blend> {
        if self.sites.is_empty() {
            return None;
        }
        let Some(d) = query.try_normalize(1e-300).filter(|d| d.iter().all(|c| c.is_finite())) else {
            return Some(Blend::site(0));
        };
        Some(match self.ring {
            Some(axis) => self.by_azimuth(&d, &axis),
            None => {
                let all = |count: usize| 0..count as u32;
                let inside = self.inside(&d, all(self.triangles.len()));
                inside.unwrap_or_else(|| self.nearest(&d, all(self.sites.len()), all(self.edges.len())))
            }
        })
    }

    /// [`DirectionComplex::blend`] of a unit vector, of which `among` holds the simplex.
    pub(crate) fn blend_among(&self, unit: &Vector3<f64>, among: &Candidates) -> Option<Blend> {
        if self.ring.is_some() || self.sites.is_empty() {
            return self.blend(unit);
        }
        let inside = self.inside(unit, among.triangles.iter().copied());
        let nearest = || self.nearest(unit, among.sites.iter().copied(), among.edges.iter().copied());
        Some(inside.unwrap_or_else(nearest))
    }

    /// At least the simplices that some direction within `radius` of unit `centre` finds.
    pub(crate) fn candidates(&self, centre: &Vector3<f64>, radius: f64) -> Candidates {
        let meets =
            |inverse: &Matrix3<f64>| inverse.row_iter().all(|row| (row * centre).x >= -row.norm() * radius - 1e-9);
        let sites: Vec<f64> = self.sites.iter().map(|s| angle(s, centre)).collect();
        let of_edge = |&[i, j]: &[u32; 2]| {
            let [i, j] = [i as usize, j as usize];
            let foot = project_to_arc(centre, &self.sites[i], &self.sites[j]);
            foot.map_or(PI, |(cosine, _)| cosine.clamp(-1.0, 1.0).acos()).min(sites[i]).min(sites[j])
        };
        let edges: Vec<f64> = self.edges.iter().map(of_edge).collect();
        let reach = sites.iter().chain(&edges).copied().fold(PI, f64::min) + 2.0 * radius;
        Candidates {
            triangles: positions(&self.inverses, meets),
            sites: positions(&sites, |&distance| distance <= reach),
            edges: positions(&edges, |&distance| distance <= reach),
        }
    }

    /// The edge that spans the azimuth of `d` about `axis`; the site nearest in azimuth where none does.
    fn by_azimuth(&self, d: &Vector3<f64>, axis: &Vector3<f64>) -> Blend {
        for &[i, j] in &self.edges {
            let start = &self.sites[i as usize];
            let (along, span) = (turn(start, d, axis), turn(start, &self.sites[j as usize], axis));
            if span > 0.0 && along >= 0.0 && along <= span {
                let t = along / span;
                return Blend { entries: [(i, 1.0 - t), (j, t), (0, 0.0)] };
            }
        }
        let off = |i: &u32| turn(&self.sites[*i as usize], d, axis).abs();
        let nearest = (0..self.sites.len() as u32).min_by(|a, b| off(a).total_cmp(&off(b)));
        Blend::site(nearest.unwrap_or(0))
    }

    /// Barycentric weights in the triangle around `d`.
    fn inside(&self, d: &Vector3<f64>, mut among: impl Iterator<Item = u32>) -> Option<Blend> {
        among.find_map(|i| {
            let (t, w) = (self.triangles[i as usize], self.inverses[i as usize] * d);
            let sum = w.sum();
            if w.min() < -1e-12 || sum <= 1e-12 {
                return None;
            }
            let w = w.map(|x| x.max(0.0));
            let w = w / w.sum();
            Some(Blend { entries: [(t[0], w.x), (t[1], w.y), (t[2], w.z)] })
        })
    }

    /// The nearest point of the edges, and of the sites that no simplex holds.
    fn nearest(&self, d: &Vector3<f64>, sites: impl Iterator<Item = u32>, edges: impl Iterator<Item = u32>) -> Blend {
        let mut best = (f64::NEG_INFINITY, Blend::site(0));
        for i in sites {
            let cosine = self.sites[i as usize].dot(d);
            if cosine > best.0 {
                best = (cosine, Blend::site(i));
            }
        }
        for [i, j] in edges.map(|edge| self.edges[edge as usize]) {
            let (a, b) = (self.sites[i as usize], self.sites[j as usize]);
            let Some((cosine, t)) = project_to_arc(d, &a, &b) else { continue };
            if cosine > best.0 {
                best = (cosine, Blend { entries: [(i, 1.0 - t), (j, t), (0, 0.0)] });
            }
        }
        best.1
    }
}

impl Blend {
    fn site(site: u32) -> Self {
        Self { entries: [(site, 1.0), (0, 0.0), (0, 0.0)] }
    }
}

/// Positions of what satisfies a condition, ascending.
fn positions<T>(items: &[T], holds: impl Fn(&T) -> bool) -> Vec<u32> {
    (0u32..).zip(items).filter(|(_, item)| holds(item)).map(|(i, _)| i).collect()
}

/// Foot of the perpendicular from `d` on the great arc from `a` to `b`: its cosine to `d` and its
/// position as a share of the arc; `None` where the foot lies off the arc.
fn project_to_arc(d: &Vector3<f64>, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<(f64, f64)> {
    let normal = a.cross(b).try_normalize(1e-12)?;
    let foot = (d - normal * normal.dot(d)).try_normalize(1e-12)?;
    let span = angle(a, b);
    let along = normal.dot(&a.cross(&foot)).atan2(a.dot(&foot));
    (along >= 0.0 && along <= span).then(|| (foot.dot(d), along / span))
}

/// The angle in −π..=π by which the azimuth of `to` about `axis` is ahead of that of `from`.
fn turn(from: &Vector3<f64>, to: &Vector3<f64>, axis: &Vector3<f64>) -> f64 {
    let from = from - axis * axis.dot(from);
    axis.dot(&from.cross(to)).atan2(from.dot(to))
}

/// Edges between neighbours in azimuth about `axis`.
fn ring_edges(sites: &[Vector3<f64>], axis: &Vector3<f64>) -> Vec<[u32; 2]> {
    if sites.len() < 2 {
        return Vec::new();
    }
    let (x, y) = tangent_frame(axis);
    let azimuth = |s: &Vector3<f64>| s.dot(&y).atan2(s.dot(&x));
    let mut order: Vec<u32> = (0..sites.len() as u32).collect();
    order.sort_by(|&i, &j| azimuth(&sites[i as usize]).total_cmp(&azimuth(&sites[j as usize])));
    let reach = RING_GAP * median_spacing(sites);
    let count = order.len();
    // Of two sites one edge leads forward, whichever of them comes first from where azimuths start.
    let is_near = |i: &Vector3<f64>, j: &Vector3<f64>| angle(i, j) <= reach && turn(i, j, axis) > 0.0;
    (0..count)
        .map(|k| [order[k], order[(k + 1) % count]])
        .filter(|&[i, j]| is_near(&sites[i as usize], &sites[j as usize]))
        .collect()
}

/// Two unit vectors that make a right-handed frame with unit `z`.
pub(crate) fn tangent_frame(z: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let helper = if z.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let x = helper.cross(z).normalize();
    (x, z.cross(&x))
}

/// Triangles and border edges of the Delaunay triangulation of the stereographic images of `sites`
/// about their mean direction.
fn delaunay(sites: &[Vector3<f64>]) -> (Vec<[u32; 3]>, Vec<[u32; 2]>) {
    let mean: Vector3<f64> = sites.iter().sum();
    let pole = mean.try_normalize(1e-6).unwrap_or_else(Vector3::z);
    let (x, y) = tangent_frame(&pole);
    // Spade takes no coordinate between 0 and 2^-142: snap what is as good as zero.
    let snap = |v: f64| if v.abs() < 1e-30 { 0.0 } else { v };
    let mut plane: DelaunayTriangulation<PlaneSite> = DelaunayTriangulation::new();
    for (site, s) in (0u32..).zip(sites) {
        let scale = 1.0 + s.dot(&pole);
        if s.dot(&x).hypot(s.dot(&y)) > STEREOGRAPHIC_REACH * scale {
            continue;
        }
        let position = Point2::new(snap(s.dot(&x) / scale), snap(s.dot(&y) / scale));
        // An error means a coordinate that is not finite; such a site answers as an isolated one.
        let _ = plane.insert(PlaneSite { position, site });
    }
    let triangles = plane.inner_faces().map(|f| f.vertices().map(|v| v.data().site)).collect();
    let edges = plane
        .undirected_edges()
        .filter(|e| e.is_part_of_convex_hull())
        .map(|e| e.vertices().map(|v| v.data().site))
        .collect();
    (triangles, edges)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn ring(n: usize, elevation: f64) -> Vec<Vector3<f64>> {
        (0..n)
            .map(|k| {
                let a = TAU * k as f64 / n as f64;
                Vector3::new(elevation.cos() * a.cos(), elevation.cos() * a.sin(), elevation.sin())
            })
            .collect()
    }

    fn dome() -> Vec<Vector3<f64>> {
        [0.1, 0.6, 1.1].iter().zip([12, 9, 5]).flat_map(|(&e, n)| ring(n, e)).collect()
    }

    fn dense(complex: &DirectionComplex, d: Vector3<f64>) -> Vec<f64> {
        let mut w = vec![0.0; complex.sites().len()];
        complex.blend(&d).unwrap().entries.iter().for_each(|&(i, x)| w[i as usize] += x);
        w
    }

    fn check_unit_at_sites(complex: &DirectionComplex) {
        for (i, s) in complex.sites().to_vec().into_iter().enumerate() {
            assert!((dense(complex, s)[i] - 1.0).abs() < 1e-9, "site {i}");
        }
    }

    fn check_continuous(complex: &DirectionComplex, elevation: f64, bound: f64) {
        let at = |k: usize| {
            let a = TAU * k as f64 / 10_000.0;
            dense(complex, Vector3::new(elevation.cos() * a.cos(), elevation.cos() * a.sin(), elevation.sin()))
        };
        for k in 0..10_000 {
            let (a, b) = (at(k), at(k + 1));
            let jump = a.iter().zip(&b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            assert!(jump < bound, "jump {jump} at {k}");
            assert!((a.iter().sum::<f64>() - 1.0).abs() < 1e-12, "partition of unity at {k}");
        }
    }

    #[test]
    fn a_ring_is_told_from_a_dome() {
        assert!(matches!(layout(&ring(36, 0.3)), Layout::Ring(a) if a.z.abs() > 0.999), "ring");
        assert_eq!(layout(&dome()), Layout::General);
    }

    #[test]
    fn ring_weights_are_unit_at_sites_and_seamless_all_around() {
        let sites = ring(24, 0.4);
        let complex = DirectionComplex::build(&sites, layout(&sites));
        assert_eq!(complex.edges().len(), 24);
        check_unit_at_sites(&complex);
        // A step of 1/10000 turn moves a weight by 24/10000 between neighbours.
        check_continuous(&complex, 0.4, 0.0035);
        check_continuous(&complex, 0.9, 0.0035);
        check_continuous(&complex, -0.3, 0.0035);
    }

    #[test]
    fn dome_weights_are_unit_at_sites_and_continuous_inside_and_outside() {
        let complex = DirectionComplex::build(&dome(), Layout::General);
        check_unit_at_sites(&complex);
        for elevation in [0.0, 0.35, 0.8, 1.3] {
            check_continuous(&complex, elevation, 0.01);
        }
    }

    #[test]
    fn weights_do_not_depend_on_the_frame() {
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, -1.1, 2.0);
        let turned: Vec<_> = dome().iter().map(|d| turn * d).collect();
        let (a, b) =
            (DirectionComplex::build(&dome(), Layout::General), DirectionComplex::build(&turned, Layout::General));
        // Off the mirror planes of the rings, where Delaunay is unique.
        for q in [Vector3::new(0.9, 0.13, 0.4), Vector3::new(-0.2, 0.77, 0.61)] {
            let (w, v) = (dense(&a, q), dense(&b, turn * q));
            assert!(w.iter().zip(&v).all(|(x, y)| (x - y).abs() < 1e-9), "{q}");
        }
    }

    #[test]
    fn a_half_ring_clamps_at_its_ends() {
        let sites: Vec<_> = ring(36, 0.2).into_iter().take(18).collect();
        let complex = DirectionComplex::build(&sites, layout(&sites));
        assert_eq!(complex.edges().len(), 17);
        assert!((dense(&complex, Vector3::new(0.9, -0.4, 0.2))[0] - 1.0).abs() < 1e-12, "clamped to the first");
    }

    #[test]
    fn near_duplicates_are_merged() {
        let mut sites = ring(12, 0.0);
        sites.push(sites[3] + Vector3::new(0.0, 0.0, 1e-6));
        sites.push(sites[3]);
        let groups = merge_directions(&sites);
        assert_eq!(groups.len(), 12);
        assert_eq!(groups[3], [3, 12, 13]);
    }

    #[test]
    fn a_turn_filmed_twice_is_one_ring() {
        let noisy = |k: usize| Vector3::new((k * 7 % 5) as f64, (k * 3 % 7) as f64, (k * 11 % 3) as f64) * 2e-4;
        let mut sites = ring(36, 0.3);
        let again: Vec<_> = sites.iter().enumerate().map(|(k, s)| (s + noisy(k)).normalize()).collect();
        sites.extend(again);
        assert!(matches!(layout(&sites), Layout::Ring(_)), "layout");
        let groups = merge_directions(&sites);
        assert_eq!(groups.len(), 36);
        assert_eq!(groups[5], [5, 41]);
        // A film that rests on its first frame.
        let mut rest = ring(36, 0.3);
        rest.extend(vec![rest[0]; 100]);
        assert_eq!(merge_directions(&rest).len(), 36);
        assert!(matches!(layout(&rest), Layout::Ring(_)), "resting film");
    }

    #[test]
    fn a_dense_film_is_not_thinned() {
        assert_eq!(merge_directions(&ring(1000, 0.2)).len(), 1000);
        assert_eq!(merge_directions(&dome()).len(), dome().len());
        assert_eq!(merge_directions(&[Vector3::x(); 4]).len(), 1);
        assert!(merge_directions(&[]).is_empty());
    }

    #[test]
    fn two_sites_of_a_ring_are_joined_wherever_azimuth_starts() {
        let at = |degrees: f64| Vector3::new(degrees.to_radians().cos(), degrees.to_radians().sin(), 0.2).normalize();
        for k in 0..36 {
            let (a, b) = (f64::from(k) * 10.0, f64::from(k) * 10.0 + 20.0);
            for sites in [[at(a), at(b)], [at(b), at(a)]] {
                let complex = DirectionComplex::build(&sites, Layout::Ring(Vector3::z()));
                let w = dense(&complex, at(0.5 * (a + b)));
                assert!((w[0] - 0.5).abs() < 1e-9 && (w[1] - 0.5).abs() < 1e-9, "{w:?} from {a}°");
            }
        }
    }

    #[test]
    fn few_sites_and_bad_queries_have_documented_answers() {
        assert_eq!(DirectionComplex::build(&[], Layout::General).blend(&Vector3::x()), None);
        let one = DirectionComplex::build(&[Vector3::x()], Layout::General);
        assert_eq!(one.blend(&-Vector3::x()), Some(Blend::site(0)));
        assert_eq!(one.blend(&Vector3::zeros()), Some(Blend::site(0)));
        assert_eq!(one.blend(&Vector3::new(f64::NAN, 0.0, 0.0)), Some(Blend::site(0)));
        let two = DirectionComplex::build(&[Vector3::x(), Vector3::y()], Layout::General);
        let middle = dense(&two, Vector3::new(1.0, 1.0, 0.3));
        assert!((middle[0] - 0.5).abs() < 1e-9 && (middle[1] - 0.5).abs() < 1e-9, "{middle:?}");
    }

    #[test]
    fn an_index_out_of_range_is_refused() {
        assert!(
            DirectionComplex::from_parts(vec![Vector3::x()], vec![[0, 1, 0]], vec![], Layout::General).is_none(),
            "triangle"
        );
        assert!(
            DirectionComplex::from_parts(vec![Vector3::x() * 2.0], vec![], vec![], Layout::General).is_none(),
            "not unit"
        );
    }
}
