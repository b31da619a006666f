//! How far two pictures of the same thing are apart.

use capture::Image;

/// What two pictures of the same thing may differ by.
#[derive(Debug, Default)]
pub(crate) struct Difference {
    /// Pixels wholly covered in both.
    pub(crate) inner: usize,
    /// Of these, further apart than one level.
    pub(crate) inner_off: usize,
    /// Pixels partly covered in either.
    pub(crate) edge: usize,
    /// Of these, further apart than one level, coverage included.
    pub(crate) edge_off: usize,
}

pub(crate) fn difference(a: &Image<[u8; 4]>, b: &Image<[u8; 4]>) -> Difference {
    assert_eq!((a.width(), a.height()), (b.width(), b.height()));
    let mut out = Difference::default();
    for (p, q) in a.pixels().iter().zip(b.pixels()).filter(|(p, q)| p[3] > 0 || q[3] > 0) {
        let off = usize::from((0..4).any(|c| p[c].abs_diff(q[c]) > 1));
        if p[3] == 255 && q[3] == 255 {
            out.inner += 1;
            out.inner_off += off;
        } else {
            out.edge += 1;
            out.edge_off += off;
        }
    }
    out
}
