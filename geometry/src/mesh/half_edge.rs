//! Which faces meet across which edges. Knows indices only, no coordinates.
//!
//! Half-edge `3 f + k` runs from corner `k` of face `f` to corner `k + 1`. Two half-edges are twins if
//! they join the same two vertices in opposite directions and no third one does. Everything else (a
//! border, an edge of three faces, two faces wound against each other) has no twin: algorithms see a
//! border there, which is always safe.

/// No twin.
pub const NO_TWIN: u32 = u32::MAX;

/// The twins of all half-edges, and what kept the others from having one.
#[derive(Clone, Debug, Default)]
pub struct HalfEdges {
    /// Per half-edge its twin, or [`NO_TWIN`].
    pub twins: Vec<u32>,
    /// Edges of one face.
    pub border_edges: usize,
    /// Edges of three faces and more.
    pub crowded_edges: usize,
    /// Edges of two faces that run through it in the same direction.
    pub miswound_edges: usize,
}

impl HalfEdges {
    /// Pairs the half-edges of triangles over `vertices` vertices, in O(faces). All indices must be
    /// below `vertices`.
    pub fn new(faces: &[[u32; 3]], vertices: usize) -> Self {
        let mut found = Self { twins: vec![NO_TWIN; faces.len() * 3], ..Self::default() };
        let (starts, mut entries) = bucket_by_lower_vertex(faces, vertices);
        for bucket in starts.windows(2) {
            let bucket = &mut entries[bucket[0]..bucket[1]];
            bucket.sort_unstable();
            bucket.chunk_by(|a, b| a.0 == b.0).for_each(|edge| found.pair(faces, edge));
        }
        found
    }

    /// The face across edge `k` of `face`.
    pub fn across(&self, face: usize, k: usize) -> Option<usize> {
        let twin = self.twins[3 * face + k];
        (twin != NO_TWIN).then_some(twin as usize / 3)
    }

    /// True if every edge has exactly two faces that agree on its direction.
    pub fn is_closed(&self) -> bool {
        self.border_edges + self.crowded_edges + self.miswound_edges == 0
    }

    fn pair(&mut self, faces: &[[u32; 3]], edge: &[(u32, u32)]) {
        match *edge {
            [_] => self.border_edges += 1,
            [(_, a), (_, b)] if start(faces, a) != start(faces, b) => {
                self.twins[a as usize] = b;
                self.twins[b as usize] = a;
            }
            [_, _] => self.miswound_edges += 1,
            _ => self.crowded_edges += 1,
        }
    }
}

/// The vertex a half-edge starts from.
pub fn start(faces: &[[u32; 3]], half_edge: u32) -> u32 {
    faces[half_edge as usize / 3][half_edge as usize % 3]
}

/// The vertex a half-edge ends at.
pub fn end(faces: &[[u32; 3]], half_edge: u32) -> u32 {
    faces[half_edge as usize / 3][(half_edge as usize + 1) % 3]
}

/// Disjoint sets over `0..n`; the representative is the smallest member, so results do not depend on
/// the order of joins.
#[derive(Clone, Debug)]
pub struct Sets(Vec<u32>);

impl Sets {
    /// `n` sets of one.
    pub fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    /// The smallest member of the set of `i`.
    pub fn find(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    /// Joins the sets of `a` and `b`.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

/// Per corner `3 f + k` the smallest corner of its fan: corners of one vertex that reach each other
/// across twins. A vertex with two fans is not manifold.
pub fn corner_fans(half_edges: &HalfEdges) -> Sets {
    let mut fans = Sets::new(half_edges.twins.len());
    for (half_edge, &twin) in half_edges.twins.iter().enumerate() {
        if twin != NO_TWIN {
            fans.join(half_edge as u32, next(twin));
            fans.join(next(half_edge as u32), twin);
        }
    }
    fans
}

/// The next half-edge (or corner) around the same face.
pub fn next(half_edge: u32) -> u32 {
    if half_edge % 3 == 2 { half_edge - 2 } else { half_edge + 1 }
}

/// Half-edges as (upper vertex, half-edge), counting-sorted by their lower vertex.
fn bucket_by_lower_vertex(faces: &[[u32; 3]], vertices: usize) -> (Vec<usize>, Vec<(u32, u32)>) {
    let ends = |h: u32| (start(faces, h), end(faces, h));
    let all = 0..3 * faces.len() as u32;
    let mut starts = vec![0_usize; vertices + 1];
    for (a, b) in all.clone().map(ends) {
        starts[a.min(b) as usize + 1] += 1;
    }
    for v in 0..vertices {
        starts[v + 1] += starts[v];
    }
    let mut cursor = starts.clone();
    let mut entries = vec![(0, 0); 3 * faces.len()];
    for h in all {
        let (a, b) = ends(h);
        let slot = &mut cursor[a.min(b) as usize];
        entries[*slot] = (a.max(b), h);
        *slot += 1;
    }
    (starts, entries)
}
