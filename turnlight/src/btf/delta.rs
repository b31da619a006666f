//! Codecs at equal rate: how far their error curves lie apart on average.
//!
//! A curve runs through the sizes of one codec, PSNR or RMSE over the logarithm of bytes, cubic from size to size and monotone where
//! its points are (PCHIP). Two curves are compared over the sizes both have: `1/(b − a) ∫ (f − g)`, exact, for Simpson's rule is
//! of cubics. Sources: Bjøntegaard, "Calculation of average PSNR differences between RD-curves", ITU-T VCEG-M33, 2001;
//! slopes: Fritsch, Butland, "A Method for Constructing Local Monotone Piecewise Cubic Interpolants", SIAM J. Sci. Stat. Comput.
//! 5(2), 1984. One polynomial through all points, as in the former, swings between them.

use super::CodecRun;
use serde::Serialize;

/// One codec against another, over the sizes both have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Delta {
    /// The codec.
    pub codec: &'static str,
    /// The one it is compared to.
    pub against: &'static str,
    /// How much higher its PSNR is, dB.
    pub psnr_db: f64,
    /// How much higher its RMSE is, levels of 255.
    pub rmse: f64,
    /// From and to how many bytes.
    pub bytes: [u64; 2],
}

/// All pairs of codecs that were run at two sizes or more and have sizes in common, in the order of the runs.
pub(super) fn deltas(runs: &[CodecRun]) -> Vec<Delta> {
    let mut names: Vec<&'static str> = Vec::new();
    runs.iter().for_each(|run| {
        if !names.contains(&run.name) {
            names.push(run.name);
        }
    });
    let curves: Vec<Curves> = names.iter().filter_map(|&name| Curves::of(runs, name)).collect();
    let pairs = curves.iter().flat_map(|a| curves.iter().filter(|b| b.codec != a.codec).map(move |b| (a, b)));
    let delta = |(a, b): (&Curves, &Curves)| {
        let (psnr_db, [from, to]) = a.psnr.over(&b.psnr)?;
        let (rmse, _) = a.rmse.over(&b.rmse)?;
        Some(Delta {
            codec: a.codec,
            against: b.codec,
            psnr_db,
            rmse,
            bytes: [from, to].map(|bytes| bytes.exp().round() as u64),
        })
    };
    pairs.filter_map(delta).collect()
}

/// PSNR and RMSE of a codec over the logarithm of its bytes.
struct Curves {
    codec: &'static str,
    psnr: Curve,
    rmse: Curve,
}

impl Curves {
    /// None where there are fewer than two sizes whose samples were judged.
    fn of(runs: &[CodecRun], codec: &'static str) -> Option<Self> {
        let found = runs.iter().filter(|run| run.name == codec).filter_map(|run| run.evaluation.as_ref());
        let points: Vec<[f64; 3]> = found
            .filter(|e| e.statistics.is_none() && e.score.psnr_db.is_finite())
            .map(|e| [(e.bytes as f64).ln(), e.score.psnr_db, e.score.rmse])
            .collect();
        let curve = |k: usize| Curve::new(points.iter().map(|point| [point[0], point[k]]).collect());
        Some(Self { codec, psnr: curve(1)?, rmse: curve(2)? })
    }
}

/// A monotone piecewise cubic.
struct Curve {
    /// Ascending in the first.
    points: Vec<[f64; 2]>,
    slopes: Vec<f64>,
}

impl Curve {
    /// Through two points or more; of points of one size the first is taken.
    fn new(mut points: Vec<[f64; 2]>) -> Option<Self> {
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        points.dedup_by(|a, b| a[0] == b[0]);
        let count = points.len();
        if count < 2 {
            return None;
        }
        let steps: Vec<[f64; 2]> =
            points.windows(2).map(|w| [w[1][0] - w[0][0], (w[1][1] - w[0][1]) / (w[1][0] - w[0][0])]).collect();
        let slope = |i: usize| match i {
            _ if count == 2 => steps[0][1],
            0 => end_slope(steps[0], steps[1]),
            _ if i + 1 == count => end_slope(steps[count - 2], steps[count - 3]),
            _ => inner_slope(steps[i - 1], steps[i]),
        };
        Some(Self { slopes: (0..count).map(slope).collect(), points })
    }

    fn ends(&self) -> [f64; 2] {
        [self.points[0][0], self.points[self.points.len() - 1][0]]
    }

    /// The value at `x`, which lies between the ends.
    fn at(&self, x: f64) -> f64 {
        let i = self.points.partition_point(|point| point[0] <= x).clamp(1, self.points.len() - 1) - 1;
        let ([x0, y0], [x1, y1]) = (self.points[i], self.points[i + 1]);
        let (width, t) = (x1 - x0, (x - x0) / (x1 - x0));
        let rise = t * t * (3.0 - 2.0 * t);
        let bend = width * t * (1.0 - t);
        y0 + (y1 - y0) * rise + bend * ((1.0 - t) * self.slopes[i] - t * self.slopes[i + 1])
    }

    /// How far the curve lies above another on average where both run, and where that is; none where they do not.
    fn over(&self, other: &Self) -> Option<(f64, [f64; 2])> {
        let (own, others) = (self.ends(), other.ends());
        let [from, to] = [own[0].max(others[0]), own[1].min(others[1])];
        if from >= to {
            return None;
        }
        let knots = self.points.iter().chain(&other.points).map(|point| point[0]);
        let mut knots: Vec<f64> = knots.filter(|x| (from..=to).contains(x)).collect();
        knots.sort_by(f64::total_cmp);
        let gap = |x: f64| self.at(x) - other.at(x);
        let simpson = |w: &[f64]| (w[1] - w[0]) / 6.0 * (gap(w[0]) + 4.0 * gap(0.5 * (w[0] + w[1])) + gap(w[1]));
        Some((knots.windows(2).map(simpson).sum::<f64>() / (to - from), [from, to]))
    }
}

/// The slope between two steps of (width, slope): 0 at an extremum, else their harmonic mean, weighted.
fn inner_slope([h0, d0]: [f64; 2], [h1, d1]: [f64; 2]) -> f64 {
    if d0 * d1 <= 0.0 {
        return 0.0;
    }
    let (w0, w1) = (2.0 * h1 + h0, h1 + 2.0 * h0);
    (w0 + w1) / (w0 / d0 + w1 / d1)
}

/// The slope at an end: that of the parabola through three points, kept monotone.
fn end_slope([h0, d0]: [f64; 2], [h1, d1]: [f64; 2]) -> f64 {
    let slope = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
    match () {
        () if slope * d0 <= 0.0 => 0.0,
        () if d0 * d1 <= 0.0 && slope.abs() > 3.0 * d0.abs() => 3.0 * d0,
        () => slope,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(xs: &[f64], at_0: f64, slope: f64) -> Curve {
        Curve::new(xs.iter().map(|&x| [x, at_0 + slope * x]).collect()).unwrap()
    }

    #[test]
    fn parallel_lines_differ_by_their_distance() {
        let high = line(&[0.0, 1.0, 2.5, 4.0], 31.5, 2.0);
        let low = line(&[0.5, 2.0, 3.0, 5.0], 30.0, 2.0);
        let (delta, range) = high.over(&low).unwrap();
        assert!((delta - 1.5).abs() < 1e-12 && range == [0.5, 4.0], "{delta} {range:?}");
        assert!((low.over(&high).unwrap().0 + 1.5).abs() < 1e-12);
    }

    #[test]
    fn parallel_curves_differ_by_their_distance() {
        let bent = |shift: f64| Curve::new([0.0_f64, 1.0, 2.0, 4.0].map(|x| [x, shift - (-x).exp()]).to_vec()).unwrap();
        assert!((bent(3.25).over(&bent(1.0)).unwrap().0 - 2.25).abs() < 1e-12);
    }

    #[test]
    fn crossing_lines_cancel() {
        let (delta, _) = line(&[0.0, 2.0], 0.0, 1.0).over(&line(&[0.0, 1.0, 2.0], 2.0, -1.0)).unwrap();
        assert!(delta.abs() < 1e-12, "{delta}");
    }

    #[test]
    fn curves_between_points_are_those_of_fritsch_and_butland() {
        let curve = Curve::new(vec![[0.0, 0.0], [1.0, 1.0], [2.0, 4.0]]).unwrap();
        // By hand: slopes 0, 3/2, 4.
        assert_eq!(curve.slopes, [0.0, 1.5, 4.0]);
        assert!((curve.at(0.5) - 0.3125).abs() < 1e-12 && (curve.at(1.5) - 2.1875).abs() < 1e-12);
        let step = Curve::new(vec![[0.0, 0.0], [1.0, 0.0], [2.0, 1.0], [3.0, 1.0]]).unwrap();
        assert!((0..=300).map(|i| step.at(f64::from(i) / 100.0)).all(|y| (0.0..=1.0).contains(&y)), "no overshoot");
    }

    #[test]
    fn areas_under_cubics_are_exact() {
        let curve = Curve::new(vec![[0.0, 0.0], [1.0, 1.0], [2.0, 4.0]]).unwrap();
        // By hand, slopes 0, 3/2, 4: a piece of width 1 has the area (y0 + y1)/2 + (m0 − m1)/12.
        let (mean, _) = curve.over(&line(&[0.0, 2.0], 0.0, 0.0)).unwrap();
        assert!((mean - 4.0 / 3.0).abs() < 1e-12, "{mean}");
    }

    #[test]
    fn sizes_apart_have_no_difference() {
        assert!(line(&[0.0, 1.0], 0.0, 1.0).over(&line(&[1.0, 2.0], 0.0, 1.0)).is_none());
        assert!(Curve::new(vec![[1.0, 2.0], [1.0, 3.0]]).is_none(), "one size");
    }
}
