//! A range map of any size out of one tile, continuing itself on all sides: copies in a row overlap, and each pair
//! of neighbours is cut where they differ least, on a closed path (the double toroidal tiles of Somol and Haindl;
//! the cut is that of Efros and Freeman 2001). Where the size is a multiple of the tile's, copies fit as they are.

/// Widest overlap of two copies, texels.
const MOST_OVERLAP: usize = 16;

/// For each texel (y, x) of another size, the texel of the map it is a copy of.
pub(super) fn tiled(map: &[f64], from: [usize; 2], to: [usize; 2]) -> Vec<usize> {
    let wide = transposed(&lay_in_rows(map, from, to[0]), to[0]);
    let turned: Vec<f64> = wide.iter().map(|&texel| map[texel]).collect();
    let high = lay_in_rows(&turned, [from[1], to[0]], to[1]);
    transposed(&high.iter().map(|&place| wide[place]).collect::<Vec<_>>(), to[1])
}

fn transposed<T: Copy>(map: &[T], width: usize) -> Vec<T> {
    let height = map.len() / width.max(1);
    (0..map.len()).map(|i| map[(i % height) * width + i / height]).collect()
}

/// How copies follow one another.
struct Row<'a> {
    map: &'a [f64],
    size: [usize; 2],
    /// Where in the map every copy starts.
    start: usize,
    overlap: usize,
}

/// Copies side by side, each `to / copies` wide: places of the map.
fn lay_in_rows(map: &[f64], size: [usize; 2], to: usize) -> Vec<usize> {
    let copies = ((to as f64 / size[0] as f64).round() as usize).max(1);
    let edge = |copy: usize| copy * to / copies;
    let overlap = MOST_OVERLAP.min(size[0] / 2).min(to / copies);
    let mut lengths: Vec<usize> = (0..copies).map(|copy| edge(copy + 1) - edge(copy)).collect();
    let row = |start| Row { map, size, start, overlap };
    let best = best_start(size[0], &lengths, row);
    let row = row(best);
    let mut result = vec![0; to * size[1]];
    let mut at = 0;
    let before: Vec<usize> = lengths.iter().copied().cycle().skip(copies - 1).take(copies).collect();
    for (length, before) in lengths.drain(..).zip(before) {
        let cut = row.cut(before).1;
        for y in 0..size[1] {
            for t in 0..length {
                let continued = t < cut[y];
                result[y * to + at + t] = if continued { row.place(y, before + t) } else { row.place(y, t) };
            }
        }
        at += length;
    }
    result
}

/// The start whose cuts cost least.
fn best_start<'a>(width: usize, lengths: &[usize], row: impl Fn(usize) -> Row<'a>) -> usize {
    let mut distinct = lengths.to_vec();
    distinct.sort_unstable();
    distinct.dedup();
    distinct.retain(|length| !length.is_multiple_of(width));
    if distinct.is_empty() {
        return 0;
    }
    let cost = |start: usize| distinct.iter().map(|&length| row(start).cut(length).0).sum::<f64>();
    let costs = (0..width).map(|start| (cost(start), start));
    costs.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map_or(0, |best| best.1)
}

impl Row<'_> {
    fn place(&self, y: usize, t: usize) -> usize {
        y * self.size[0] + (self.start + t) % self.size[0]
    }

    fn value(&self, y: usize, t: usize) -> f64 {
        self.map[self.place(y, t)]
    }

    /// Cost, and per row the first texel of the new copy, where the old one is `length` long.
    fn cut(&self, length: usize) -> (f64, Vec<usize>) {
        let [width, height] = self.size;
        if length.is_multiple_of(width) || self.overlap == 0 {
            return (0.0, vec![0; height]);
        }
        let difference = |y: usize, t: usize| (self.value(y, length + t) - self.value(y, t)).powi(2);
        let costs: Vec<f64> =
            (0..height * self.overlap).map(|i| difference(i / self.overlap, i % self.overlap)).collect();
        let paths = (0..self.overlap).map(|end| closed_path(&costs, self.overlap, end));
        paths.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, vec![0; height]))
    }
}

/// The cheapest path down the rows of `costs`, a step aside a row at most, that starts and ends at `end`.
fn closed_path(costs: &[f64], width: usize, end: usize) -> (f64, Vec<usize>) {
    let rows: Vec<&[f64]> = costs.chunks_exact(width).collect();
    let mut sums: Vec<f64> = (0..width).map(|x| if x == end { rows[0][x] } else { f64::INFINITY }).collect();
    let mut came = vec![vec![end; width]];
    for row in &rows[1..] {
        let from = |x: usize| {
            let reach = x.saturating_sub(1)..=(x + 1).min(width - 1);
            reach.min_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or(x)
        };
        let steps: Vec<usize> = (0..width).map(from).collect();
        sums = (0..width).map(|x| sums[steps[x]] + row[x]).collect();
        came.push(steps);
    }
    let reach = end.saturating_sub(1)..=(end + 1).min(width - 1);
    let mut x = reach.min_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or(end);
    let cost = sums[x];
    let mut path = vec![0; rows.len()];
    for y in (0..rows.len()).rev() {
        path[y] = x;
        x = came[y][x];
    }
    (cost, path)
}
