// Multi-level vector quantisation: chains of look-ups; `texture::btf::multilevel_vq`.
// tables[0]: slices, cells, polar angles, azimuths of the grid. tables[1]: 1 where the light's poles lie along the view's
// azimuth; links of P6; first of turns; of P6. tables[2]: first of P4, P3, P2, P1. tables[3]: first of I2, of I1's colours;
// the last polar angle, a float by its bits.

struct Between {
    low: u32,
    high: u32,
    t: f32,
}

struct Place {
    theta: Between,
    phi: Between,
    // Slice and cell of the light as seen from either azimuth.
    slices: array<Between, 2>,
    cells: array<Between, 2>,
}

const PI = 3.141592653589793;

// Held at both ends.
fn held(at: f32, count: u32) -> Between {
    let place = clamp(at, 0.0, f32(count - 1u));
    let low = min(u32(place), max(count, 2u) - 2u);
    return Between(low, min(low + 1u, count - 1u), place - f32(low));
}

fn wrapped(at: f32, count: u32) -> Between {
    let place = select(at, at + f32(count), at < 0.0);
    let low = min(u32(place), count - 1u);
    return Between(low, select(low + 1u, 0u, low + 1u == count), min(place - f32(low), 1.0));
}

fn nodes(between: Between) -> array<u32, 2> {
    return array(between.low, between.high);
}

fn shares(between: Between) -> array<f32, 2> {
    return array(1.0 - between.t, between.t);
}

fn place(light: vec3<f32>, view: vec3<f32>) -> Place {
    let grid = coat.tables[0];
    let radius = length(view.xy);
    let theta = arctangent(radius, max(view.z, 0.0)) * f32(grid.z - 1u) / bitcast<f32>(coat.tables[3].z);
    let phi = wrapped(arctangent(view.y, view.x) * f32(grid.w) / (2.0 * PI), grid.w);
    var found: Place;
    found.theta = held(theta, grid.z);
    found.phi = phi;
    let azimuths = nodes(phi);
    for (var i = 0u; i < 2u; i++) {
        let turn = pair(coat.tables[1].z + 2u * azimuths[i]);
        let seen = vec2(turn.x * light.x + turn.y * light.y, turn.x * light.y - turn.y * light.x);
        let s = select(seen.yx, seen.xy, coat.tables[1].x == 1u);
        let at_pole = abs(s.y) + abs(light.z) < 1e-7;
        let alpha = select(arctangent(s.y, max(light.z, 0.0)), 0.0, at_pole);
        found.slices[i] = held((alpha / PI + 0.5) * f32(grid.x) - 0.5, grid.x);
        found.cells[i] = held((clamp(s.x, -1.0, 1.0) + 1.0) * 0.5 * f32(grid.y) - 0.5, grid.y);
    }
    return found;
}

fn value(texel: u32, place: Place) -> vec3<f32> {
    let grid = coat.tables[0];
    let item = coat.tables[1].w + 2u * select(texel, 0u, coat.tables[1].y == 1u);
    let azimuths = nodes(place.phi);
    let polars = nodes(place.theta);
    // Y, Cr, Cb.
    var sum = vec3(0.0);
    for (var p = 0u; p < 2u; p++) {
        let azimuth = coat.tables[2].x + 2u * (numbers[item] * grid.w + azimuths[p]);
        for (var t = 0u; t < 2u; t++) {
            let weight = shares(place.phi)[p] * shares(place.theta)[t];
            let view = coat.tables[2].y + 3u * (numbers[azimuth] + polars[t]);
            let scale = number(item + 1u) * number(azimuth + 1u) * number(view + 2u);
            sum += weight * corners(view, place.slices[p], place.cells[p]) * vec3(scale, 1.0, 1.0);
        }
    }
    let rgb = vec3(sum.x + 1.402 * sum.y, sum.x - 0.7141363 * sum.y - 0.3441363 * sum.z, sum.x + 1.772 * sum.z);
    return max(rgb, vec3(0.0));
}

// The four cells about a light, under an entry of P3.
fn corners(view: u32, slice: Between, cell: Between) -> vec3<f32> {
    let alphas = nodes(slice);
    var sum = vec3(0.0);
    for (var a = 0u; a < 2u; a++) {
        let weight = shares(slice)[a];
        let link = coat.tables[2].z + 2u * (numbers[view] + alphas[a]);
        let row = coat.tables[2].w + numbers[link];
        let luma = number(link + 1u) * mix(number(row + cell.low), number(row + cell.high), cell.t);
        let colors = coat.tables[3].y + 2u * numbers[coat.tables[3].x + numbers[view + 1u] + alphas[a]];
        let chroma = mix(pair(colors + 2u * cell.low), pair(colors + 2u * cell.high), cell.t);
        sum += weight * vec3(luma, chroma);
    }
    return sum;
}
