//! Building closed meshes from loops of vertices.
//!
//! A loop is a cycle of vertex indices, counter-clockwise seen from outside (from above, for loops
//! around the z axis). Faces between loops share their vertices, so what is built from one loop to
//! the next and capped at both ends is one closed manifold.

use geometry::Mesh;
use nalgebra::{Point3, Vector3};
use std::f64::consts::{PI, TAU};

/// A place or a direction.
pub(crate) type P = Vector3<f64>;

/// A mesh under construction with a part number per face.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeshBuilder {
    /// What has been built.
    pub(crate) mesh: Mesh,
    /// The part each face belongs to.
    pub(crate) parts: Vec<u8>,
    /// The part of the faces to come.
    pub(crate) part: u8,
}

/// Quads left out between rings: from `low` for `size` rings and columns, which go around.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hole {
    /// First ring and first column.
    pub(crate) low: [usize; 2],
    /// Number of quads across rings and across columns.
    pub(crate) size: [usize; 2],
}

impl Hole {
    fn holds(&self, ring: usize, column: usize, around: usize) -> bool {
        let past = (column + around - self.low[1]) % around;
        (self.low[0]..self.low[0] + self.size[0]).contains(&ring) && past < self.size[1]
    }

    /// Row and column of the points around the hole, counter-clockwise from outside.
    fn outline(&self) -> Vec<(usize, usize)> {
        let [rows, columns] = self.size;
        let bottom = (0..columns).map(|c| (0, c));
        let right = (0..rows).map(|r| (r, columns));
        let top = (1..=columns).rev().map(|c| (rows, c));
        let left = (1..=rows).rev().map(|r| (r, 0));
        bottom.chain(right).chain(top).chain(left).collect()
    }

    fn vertex(&self, rings: &[Vec<u32>], row: usize, column: usize) -> u32 {
        let ring = &rings[self.low[0] + row];
        ring[(self.low[1] + column) % ring.len()]
    }
}

impl MeshBuilder {
    /// Adds vertices; positions are rounded to single precision, so that what is traced and what is
    /// written to disk are the same surface.
    pub(crate) fn ring(&mut self, points: impl IntoIterator<Item = [f64; 3]>) -> Vec<u32> {
        let first = self.mesh.positions.len() as u32;
        let rounded = points.into_iter().map(|p| Point3::from(p.map(|c| f64::from(c as f32))));
        self.mesh.positions.extend(rounded);
        (first..self.mesh.positions.len() as u32).collect()
    }

    /// The four corners of a rectangle around the z axis.
    pub(crate) fn rectangle(&mut self, half: [f64; 2], z: f64) -> Vec<u32> {
        let [x, y] = half;
        self.ring([[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]])
    }

    /// Moves the mesh up or down until its lowest point is on the table.
    pub(crate) fn set_down(self) -> Self {
        let bottom = self.mesh.positions.iter().fold(f64::INFINITY, |m, p| m.min(p.z));
        self.moved(|p| p - P::z() * bottom)
    }

    /// Drops vertices of no face, as lie within what was left open.
    pub(crate) fn without_strays(mut self) -> Self {
        let mut is_used = vec![false; self.mesh.positions.len()];
        self.mesh.faces.as_flattened().iter().for_each(|&v| is_used[v as usize] = true);
        let mut next = 0;
        let place: Vec<u32> = is_used.iter().map(|&used| (next, next += u32::from(used)).0).collect();
        self.mesh.faces.as_flattened_mut().iter_mut().for_each(|v| *v = place[*v as usize]);
        let mut used = is_used.iter();
        self.mesh.positions.retain(|_| used.next() == Some(&true));
        self
    }

    /// The same faces with every vertex moved.
    pub(crate) fn moved(mut self, place: impl Fn(P) -> P) -> Self {
        for p in &mut self.mesh.positions {
            *p = place(p.coords).map(|c| f64::from(c as f32)).into();
        }
        self
    }

    /// Adds one triangle.
    pub(crate) fn face(&mut self, face: [u32; 3]) {
        self.mesh.faces.push(face);
        self.parts.push(self.part);
    }

    /// A band of quads from loop `a` to loop `b` of the same length, `b` above `a`, facing outward.
    pub(crate) fn walls(&mut self, a: &[u32], b: &[u32]) {
        for i in 0..a.len().min(b.len()) {
            let j = (i + 1) % a.len();
            self.face([a[i], a[j], b[j]]);
            self.face([a[i], b[j], b[i]]);
        }
    }

    /// Walls through all `loops` in turn.
    pub(crate) fn loft(&mut self, loops: &[Vec<u32>]) {
        for pair in loops.windows(2) {
            self.walls(&pair[0], &pair[1]);
        }
    }

    /// Closes a convex loop.
    pub(crate) fn cap(&mut self, ring: &[u32]) {
        for i in 1..ring.len().saturating_sub(1) {
            self.face([ring[0], ring[i], ring[i + 1]]);
        }
    }

    /// Closes a convex loop facing the other way.
    pub(crate) fn cap_reversed(&mut self, ring: &[u32]) {
        for i in 1..ring.len().saturating_sub(1) {
            self.face([ring[0], ring[i + 1], ring[i]]);
        }
    }

    /// Fills between an outer and an inner convex loop in one plane, seen counter-clockwise.
    /// Of the two ways to go on, the one with the shorter diagonal is taken.
    pub(crate) fn annulus(&mut self, outer: &[u32], inner: &[u32]) {
        self.bridge(outer, inner, false);
    }

    /// [`MeshBuilder::annulus`] facing the other way.
    pub(crate) fn annulus_reversed(&mut self, outer: &[u32], inner: &[u32]) {
        self.bridge(outer, inner, true);
    }

    /// Closes a loop that its middle sees whole by a fan around a new vertex at `tip`.
    pub(crate) fn fan(&mut self, ring: &[u32], tip: P) {
        let tip = self.ring([tip.into()])[0];
        for i in 0..ring.len() {
            self.face([ring[i], ring[(i + 1) % ring.len()], tip]);
        }
    }

    /// [`MeshBuilder::fan`] facing the other way.
    pub(crate) fn fan_reversed(&mut self, ring: &[u32], tip: P) {
        let reversed: Vec<u32> = ring.iter().rev().copied().collect();
        self.fan(&reversed, tip);
    }

    /// A closed tube along `path`: point `i` of ring `k` lies `offset(k, angle)` off the path, along the
    /// two normals of a frame that does not twist (Wang et al., "Computation of Rotation Minimizing
    /// Frames", TOG 2008), the first of which starts near `up`. Ends are capped by fans.
    pub(crate) fn tube(&mut self, path: &[P], up: P, sides: usize, offset: impl Fn(usize, f64) -> [f64; 2]) {
        let mut rings = Vec::with_capacity(path.len());
        for (k, frame) in frames(path, up).into_iter().enumerate() {
            let point = |i: usize| {
                let [a, b] = offset(k, TAU * i as f64 / sides as f64);
                (path[k] + frame[0] * a + frame[1] * b).into()
            };
            rings.push(self.ring((0..sides).map(point)));
        }
        self.loft(&rings);
        if let (Some(first), Some(last)) = (rings.first(), rings.last()) {
            self.fan_reversed(first, path[0]);
            self.fan(last, path[path.len() - 1]);
        }
    }

    /// A solid between a front and a back over `[0, 1]²`: `point(u, v)` gives both. The front is seen
    /// with `u × v` towards the eye. `cells` are along u and v.
    pub(crate) fn slab(&mut self, cells: [usize; 2], point: impl Fn(f64, f64) -> [P; 2]) {
        let [nu, nv] = cells;
        let at = |i: usize, j: usize| point(i as f64 / nu as f64, j as f64 / nv as f64);
        let side = |face: usize| (0..=nv).flat_map(move |j| (0..=nu).map(move |i| (i, j, face)));
        let [front, back] = [0, 1].map(|face| self.ring(side(face).map(|(i, j, f)| at(i, j)[f].into())));
        let id = |i: usize, j: usize| j * (nu + 1) + i;
        for (i, j) in (0..nv).flat_map(|j| (0..nu).map(move |i| (i, j))) {
            let quad = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            self.cap(&quad.map(|k| front[k]));
            self.cap_reversed(&quad.map(|k| back[k]));
        }
        let rim = (0..nu)
            .map(|i| id(i, 0))
            .chain((0..nv).map(|j| id(nu, j)))
            .chain((1..=nu).rev().map(|i| id(i, nv)))
            .chain((1..=nv).rev().map(|j| id(0, j)));
        let rim: Vec<usize> = rim.collect();
        let [low, high] = [&back, &front].map(|face| rim.iter().map(|&k| face[k]).collect::<Vec<_>>());
        self.walls(&low, &high);
    }

    /// A sheet of the given half thickness around the surface `middle(u, v)` over `[0, 1]²`.
    pub(crate) fn sheet(&mut self, cells: [usize; 2], half: f64, middle: impl Fn(f64, f64) -> P) {
        const H: f64 = 1e-3;
        self.slab(cells, |u, v| {
            let du = middle(u + H, v) - middle(u - H, v);
            let dv = middle(u, v + H) - middle(u, v - H);
            let n = du.cross(&dv).try_normalize(0.0).unwrap_or_else(P::z) * half;
            let p = middle(u, v);
            [p + n, p - n]
        });
    }

    /// A ball with `n` rings' steps from pole to pole and `2 n` points around, moved to `point(direction)`,
    /// which must keep the ball the right side out.
    pub(crate) fn ball(&mut self, n: usize, point: impl Fn(P) -> P) {
        let direction = |k: usize, i: usize| {
            let (s, c) = (PI * k as f64 / n as f64).sin_cos();
            let (sp, cp) = (PI * i as f64 / n as f64).sin_cos();
            P::new(s * cp, s * sp, -c)
        };
        let rings: Vec<_> = (1..n).map(|k| self.ring((0..2 * n).map(|i| point(direction(k, i)).into()))).collect();
        self.loft(&rings);
        self.fan_reversed(&rings[0], point(-P::z()));
        self.fan(&rings[n - 2], point(P::z()));
    }

    /// A box with half sizes `half` along the columns of a right-handed `frame`.
    pub(crate) fn block(&mut self, center: P, frame: [P; 3], half: [f64; 3]) {
        let [x, y, z] = [0, 1, 2].map(|a| frame[a] * half[a]);
        self.slab([1, 1], |u, v| {
            let p = center + x * (2.0 * u - 1.0) + y * (2.0 * v - 1.0);
            [p + z, p - z]
        });
    }

    /// Rings of a surface of revolution around the z axis, one per (radius, z), not yet joined;
    /// `stretch(ring, angle)` scales the radius.
    pub(crate) fn revolve(
        &mut self,
        profile: &[[f64; 2]],
        around: usize,
        stretch: impl Fn(usize, f64) -> f64,
    ) -> Vec<Vec<u32>> {
        let mut rings = Vec::with_capacity(profile.len());
        for (k, &[radius, z]) in profile.iter().enumerate() {
            let point = |i: usize| {
                let turn = TAU * i as f64 / around as f64;
                let r = radius * stretch(k, turn);
                [r * turn.cos(), r * turn.sin(), z]
            };
            rings.push(self.ring((0..around).map(point)));
        }
        rings
    }

    /// Closes the first and the last of the rings of a surface of revolution on the axis.
    pub(crate) fn close_poles(&mut self, rings: &[Vec<u32>]) {
        let height = |b: &Self, ring: &[u32]| P::z() * ring.first().map_or(0.0, |&v| b.mesh.positions[v as usize].z);
        if let (Some(first), Some(last)) = (rings.first(), rings.last()) {
            let (low, high) = (height(self, first), height(self, last));
            self.fan_reversed(first, low);
            self.fan(last, high);
        }
    }

    /// Moves the edge of a rectangular hole along the surface onto the ellipse it contains, by drawing every
    /// point towards the middle: `(x, y) max(|x|, |y|) / √(x² + y²)`.
    fn round(&mut self, hole: &Hole, rings: &[Vec<u32>]) {
        let [rows, columns] = hole.size;
        let radius_height = |b: &Self, row: usize| {
            let p = b.mesh.positions[rings[row][0] as usize];
            [p.x.hypot(p.y), p.z]
        };
        let profile: Vec<[f64; 2]> = (0..=rows).map(|r| radius_height(self, hole.low[0] + r)).collect();
        let turn = TAU / rings[0].len() as f64;
        for (r, c) in hole.outline() {
            let (x, y) = (2.0 * c as f64 / columns as f64 - 1.0, 2.0 * r as f64 / rows as f64 - 1.0);
            let shrink = x.abs().max(y.abs()) / x.hypot(y);
            let row = 0.5 * rows as f64 * (1.0 + y * shrink);
            let k = (row as usize).min(rows - 1);
            let [radius, z] = [0, 1].map(|a| profile[k][a] + (profile[k + 1][a] - profile[k][a]) * (row - k as f64));
            let angle = turn * (hole.low[1] as f64 + 0.5 * columns as f64 * (1.0 + x * shrink));
            let place = Point3::new(radius * angle.cos(), radius * angle.sin(), z);
            let vertex = hole.vertex(rings, r, c);
            self.mesh.positions[vertex as usize] = place.map(|c| f64::from(c as f32));
        }
    }

    /// A tube that grows out of the edge of a hole along `path`, which starts in the hole's middle: over
    /// the first `blend` rings its section turns from the hole's outline into `half(k)`, the half axes
    /// of an ellipse along the normals of [`frames`]. Returns the last ring.
    pub(crate) fn sleeve(
        &mut self,
        hole: &[u32],
        path: &[P],
        up: P,
        blend: usize,
        half: impl Fn(usize) -> [f64; 2],
    ) -> Vec<u32> {
        let frames = frames(path, up);
        let Some(&[u, v]) = frames.first() else { return hole.to_vec() };
        let starts: Vec<P> = hole.iter().map(|&i| self.mesh.positions[i as usize].coords - path[0]).collect();
        let mut last = hole.to_vec();
        for k in 1..path.len() {
            let t = (k as f64 / blend as f64).min(1.0);
            let t = t * t * (3.0 - 2.0 * t);
            let [a, b] = half(k);
            let point = |start: &P| {
                let (along_u, along_v) = (start.dot(&u), start.dot(&v));
                let angle = along_v.atan2(along_u);
                // What is left of the hole's own outline, its bulge along the path included.
                let lift = start.dot(&u.cross(&v));
                let (x, y) = (along_u + (a * angle.cos() - along_u) * t, along_v + (b * angle.sin() - along_v) * t);
                let tangent = frames[k][0].cross(&frames[k][1]);
                (path[k] + frames[k][0] * x + frames[k][1] * y + tangent * (lift * (1.0 - t))).into()
            };
            let ring = self.ring(starts.iter().map(point).collect::<Vec<[f64; 3]>>());
            self.walls(&last, &ring);
            last = ring;
        }
        last
    }

    /// Joins two sleeves that meet: their last rings, each counter-clockwise seen from the other.
    pub(crate) fn join(&mut self, a: &[u32], b: &[u32]) {
        let n = a.len();
        let turned = |shift: usize| -> Vec<u32> { (0..n).map(|i| b[(shift + n - i) % n]).collect() };
        let gap = |ring: &[u32]| -> f64 { a.iter().zip(ring).map(|(&p, &q)| self.distance(p, q)).sum() };
        if let Some(ring) = (0..n).map(turned).min_by(|p, q| gap(p).total_cmp(&gap(q))) {
            self.walls(a, &ring);
        }
    }

    /// [`MeshBuilder::loft`] of a surface of revolution that leaves `holes` open, rounds them, and returns
    /// their edges, counter-clockwise from outside.
    pub(crate) fn loft_around(&mut self, rings: &[Vec<u32>], holes: &[Hole]) -> Vec<Vec<u32>> {
        holes.iter().for_each(|h| self.round(h, rings));
        let n = rings.first().map_or(0, Vec::len);
        for (k, pair) in rings.windows(2).enumerate() {
            let (a, b) = (&pair[0], &pair[1]);
            for i in (0..n).filter(|&i| !holes.iter().any(|h| h.holds(k, i, n))) {
                let j = (i + 1) % n;
                self.face([a[i], a[j], b[j]]);
                self.face([a[i], b[j], b[i]]);
            }
        }
        let edge = |h: &Hole| h.outline().into_iter().map(|(r, c)| h.vertex(rings, r, c)).collect();
        holes.iter().map(edge).collect()
    }

    fn bridge(&mut self, outer: &[u32], inner: &[u32], reversed: bool) {
        let (n, m) = (outer.len(), inner.len());
        let Some((start_o, start_i)) = self.closest(outer, inner) else { return };
        let at_outer = |k: usize| outer[(start_o + k) % n];
        let at_inner = |k: usize| inner[(start_i + k) % m];
        let (mut o, mut i) = (0, 0);
        while o < n || i < m {
            let next_outer = self.distance(at_outer(o + 1), at_inner(i));
            let next_inner = self.distance(at_outer(o), at_inner(i + 1));
            let take_outer = i >= m || (o < n && next_outer < next_inner);
            let face = if take_outer {
                o += 1;
                [at_outer(o - 1), at_outer(o), at_inner(i)]
            } else {
                i += 1;
                [at_outer(o), at_inner(i), at_inner(i - 1)]
            };
            self.face(if reversed { [face[0], face[2], face[1]] } else { face });
        }
    }

    fn closest(&self, outer: &[u32], inner: &[u32]) -> Option<(usize, usize)> {
        let pairs = (0..outer.len()).flat_map(|o| (0..inner.len()).map(move |i| (o, i)));
        pairs.min_by(|a, b| self.distance(outer[a.0], inner[a.1]).total_cmp(&self.distance(outer[b.0], inner[b.1])))
    }

    fn distance(&self, a: u32, b: u32) -> f64 {
        nalgebra::distance(&self.mesh.positions[a as usize], &self.mesh.positions[b as usize])
    }
}

/// Two unit normals per point of a polyline that turn as little as they can, by double reflection
/// (Wang et al. 2008); with the tangent they are right-handed.
pub(crate) fn frames(path: &[P], up: P) -> Vec<[P; 2]> {
    let tangents = tangents(path);
    let Some(&first) = tangents.first() else { return Vec::new() };
    let mut normal = across(up, first);
    let mut frames = vec![[normal, first.cross(&normal)]];
    for k in 1..path.len() {
        let step = path[k] - path[k - 1];
        let mirrored = |v: P, m: P| v - m * (2.0 * m.dot(&v) / m.norm_squared().max(1e-30));
        let tangent = mirrored(tangents[k - 1], step);
        normal = across(mirrored(mirrored(normal, step), tangents[k] - tangent), tangents[k]);
        frames.push([normal, tangents[k].cross(&normal)]);
    }
    frames
}

/// Unit tangents by central differences.
fn tangents(path: &[P]) -> Vec<P> {
    let last = path.len().saturating_sub(1);
    let at = |k: usize| (path[(k + 1).min(last)] - path[k.saturating_sub(1)]).try_normalize(0.0).unwrap_or_else(P::z);
    (0..path.len()).map(at).collect()
}

/// A Catmull–Rom curve through `points`, `steps` segments between two of them; ends are doubled.
pub(crate) fn curve(points: &[P], steps: usize) -> Vec<P> {
    let last = points.len().saturating_sub(1);
    let at = |k: usize| points[k.min(last)];
    let mut path = Vec::with_capacity(last * steps + 1);
    for k in 0..last {
        let [a, b, c, d] = [at(k.saturating_sub(1)), at(k), at(k + 1), at(k + 2)];
        path.extend((0..steps).map(|i| {
            let t = i as f64 / steps as f64;
            let slope = [(c - a) * 0.5, (d - b) * 0.5];
            let (t2, t3) = (t * t, t * t * t);
            b * (2.0 * t3 - 3.0 * t2 + 1.0)
                + c * (3.0 * t2 - 2.0 * t3)
                + slope[0] * (t3 - 2.0 * t2 + t)
                + slope[1] * (t3 - t2)
        }));
    }
    path.extend(points.last());
    path
}

/// The two halves of a handle between `low` and `high`, each from its foot to where they nearly meet, at
/// `reach` from between the feet: half an ellipse that leaves both along `reach`.
pub(crate) fn ear(low: P, high: P, reach: P, steps: usize) -> [Vec<P>; 2] {
    [-1.0, 1.0].map(|sign| {
        let at = |k: usize| {
            let (s, c) = (0.5 * PI * (1.0 - 0.97 * k as f64 / steps as f64)).sin_cos();
            low.lerp(&high, 0.5 + 0.5 * sign * s) + reach * c
        };
        (0..=steps).map(at).collect()
    })
}

/// The unit vector nearest `v` that is perpendicular to the unit vector `axis`.
pub(crate) fn across(v: P, axis: P) -> P {
    let off = |v: P| (v - axis * axis.dot(&v)).try_normalize(1e-9);
    off(v).or_else(|| off(P::x())).or_else(|| off(P::y())).unwrap_or_else(P::z)
}

/// Shading normals at the corners of every face: the area-weighted mean of the faces around the
/// vertex that turn away by less than `crease_rad`.
pub(crate) fn corner_normals(mesh: &Mesh, crease_rad: f64) -> Vec<[Vector3<f32>; 3]> {
    let mut around = vec![Vec::new(); mesh.positions.len()];
    for (f, corners) in mesh.faces.iter().enumerate() {
        corners.iter().for_each(|&v| around[v as usize].push(f));
    }
    let area: Vec<_> = (0..mesh.faces.len()).map(|f| mesh.face_area_vector(f)).collect();
    let unit: Vec<_> = area.iter().map(|a| a.try_normalize(0.0).unwrap_or_default()).collect();
    let limit = crease_rad.cos();
    let normal = |f: usize, v: u32| {
        let near = around[v as usize].iter().filter(|&&g| unit[g].dot(&unit[f]) >= limit);
        near.map(|&g| area[g]).sum::<Vector3<f64>>().try_normalize(0.0).unwrap_or(unit[f]).cast()
    };
    mesh.faces.iter().enumerate().map(|(f, corners)| corners.map(|v| normal(f, v))).collect()
}

/// A sphere around the origin from `n` rings of `2 n` points: for tests with closed forms.
#[cfg(test)]
pub(crate) fn sphere(radius: f64, n: usize) -> Mesh {
    let mut b = MeshBuilder::default();
    let circle = |k: usize| {
        let (s, c) = (PI * k as f64 / n as f64).sin_cos();
        (0..2 * n).map(move |i| {
            let (sp, cp) = (PI * i as f64 / n as f64).sin_cos();
            [radius * s * cp, radius * s * sp, -radius * c]
        })
    };
    let rings: Vec<_> = (1..n).map(|k| b.ring(circle(k))).collect();
    let poles = b.ring([[0.0, 0.0, -radius], [0.0, 0.0, radius]]);
    b.loft(&rings);
    for i in 0..2 * n {
        let j = (i + 1) % (2 * n);
        b.face([poles[0], rings[0][j], rings[0][i]]);
        b.face([poles[1], rings[n - 2][i], rings[n - 2][j]]);
    }
    b.mesh
}

/// Whether every edge belongs to exactly two faces that run along it in opposite directions.
#[cfg(test)]
pub(crate) fn is_closed(mesh: &Mesh) -> bool {
    let mut edges = std::collections::BTreeMap::new();
    for &[a, b, c] in &mesh.faces {
        for e in [(a, b), (b, c), (c, a)] {
            *edges.entry(e).or_insert(0) += 1;
        }
    }
    let good = |(&(a, b), &n): (&(u32, u32), &i32)| n == 1 && edges.get(&(b, a)) == Some(&1);
    for e in edges.iter().filter(|&e| !good(e)).take(6) {
        eprintln!("bad edge at {:?}", mesh.positions[e.0.0 as usize]);
    }
    edges.iter().all(good)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_annulus_covers_the_difference_of_areas_once() {
        let mut b = MeshBuilder::default();
        let outer = b.rectangle([2.0, 3.0], 0.0);
        let circle = |i| {
            let (s, c) = (TAU * f64::from(i) / 48.0).sin_cos();
            [1.5 * c, 1.5 * s, 0.0]
        };
        let inner = b.ring((0..48).map(circle));
        b.annulus(&outer, &inner);
        let areas: Vec<f64> = (0..b.mesh.faces.len()).map(|f| b.mesh.face_area_vector(f).z / 2.0).collect();
        let expected = 24.0 - 0.5 * 48.0 * 2.25 * (TAU / 48.0).sin();
        assert!(areas.iter().all(|&a| a > 0.0));
        assert!((areas.iter().sum::<f64>() - expected).abs() < 1e-5);
    }

    #[test]
    fn the_sphere_is_closed_and_faces_outward() {
        let mesh = sphere(1.0, 48);
        assert!(is_closed(&mesh));
        assert!((mesh.signed_volume() / (4.0 / 3.0 * PI) - 1.0).abs() < 0.01);
    }
}
