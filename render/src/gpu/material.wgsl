// What a sub-sample sends to the eye where its face carries a material: `render::material`, in 32 bits.
// A codec's source follows, with `Place`, `place` (what light and view alone determine) and `value` (a texel's sample).

struct Coat {
    // Texels of the tile across and down; how many lights; 1 where samples hold the cosine.
    size: vec2<u32>,
    lights: u32,
    includes_cosine: u32,
    // z of the lowest measured light and view; 1 / exposure, 0 of a black coat; 2 to the power of the stops.
    lowest_light: f32,
    lowest_view: f32,
    inverse_exposure: f32,
    gain: f32,
    // Sides of the mesh's own atlas.
    mesh_atlas: vec2<f32>,
    // Encoding: 0 sRGB, 1 linear, 2 logarithmic; then floor and ln(1 + peak/floor).
    encoding: u32,
    floor: f32,
    range: f32,
    // Where the codec's tables lie, as its source says.
    tables: array<vec4<u32>, 4>,
}

struct Light {
    // Towards it; its place where w is 1.
    place: vec4<f32>,
    irradiance: vec4<f32>,
}

struct CoatedFace {
    // Per corner.
    normals: array<vec4<f32>, 3>,
    tangents: array<vec4<f32>, 3>,
    // Texels of the tile per texel of the mesh's atlas; 1 where mirrored in the atlas.
    tile: vec4<f32>,
}

@group(1) @binding(0) var<uniform> coat: Coat;
@group(1) @binding(1) var<storage, read> lights: array<Light>;
@group(1) @binding(2) var<storage, read> coated: array<CoatedFace>;
// The codec's tables, floats by their bits.
@group(1) @binding(3) var<storage, read> numbers: array<u32>;

struct TangentFrame {
    tangent: vec3<f32>,
    bitangent: vec3<f32>,
    normal: vec3<f32>,
}

fn number(at: u32) -> f32 {
    return bitcast<f32>(numbers[at]);
}

fn pair(at: u32) -> vec2<f32> {
    return vec2(number(at), number(at + 1u));
}

fn triple(at: u32) -> vec3<f32> {
    return vec3(number(at), number(at + 1u), number(at + 2u));
}

// What of `v` is perpendicular to unit `normal`, at unit length; zero where next to nothing is left.
fn across(v: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let rest = v - normal * dot(normal, v);
    let left = length(rest);
    return select(vec3(0.0), rest / left, left > 1e-6 * length(v));
}

fn tangent_frame(normal: vec3<f32>, along: vec3<f32>) -> TangentFrame {
    var tangent = across(along, normal);
    if all(tangent == vec3(0.0)) {
        let size = abs(normal);
        let is_x = size.x <= size.y && size.x <= size.z;
        let other = select(vec3(0.0, 0.0, 1.0), vec3(0.0, 1.0, 0.0), size.y <= size.z);
        tangent = across(select(other, vec3(1.0, 0.0, 0.0), is_x), normal);
    }
    return TangentFrame(tangent, cross(normal, tangent), normal);
}

fn local(frame: TangentFrame, v: vec3<f32>) -> vec3<f32> {
    return normalize(vec3(dot(frame.tangent, v), dot(frame.bitangent, v), dot(frame.normal, v)));
}

// A unit vector brought up to a height, its azimuth kept.
fn raised(v: vec3<f32>, lowest: f32) -> vec3<f32> {
    if v.z >= lowest {
        return v;
    }
    let radius = length(v.xy);
    let outward = select(vec2(0.0), v.xy / radius, radius > 0.0);
    return vec3(outward * sqrt(max(1.0 - lowest * lowest, 0.0)), lowest);
}

// Cells of one axis of the tile under a box: `texture::tile`.
struct Span {
    cells: array<u32, 4>,
    shares: array<f32, 4>,
    count: u32,
}

fn span(center: f32, box: f32, size: u32) -> Span {
    let side = max(box, 1.0);
    var found = Span(array<u32, 4>(0u, 0u, 0u, 0u), array<f32, 4>(1.0, 0.0, 0.0, 0.0), 1u);
    if size <= 1u || !(abs(center) <= 1073741824.0) {
        return found;
    }
    if side >= f32(max(size, 4u)) {
        for (var k = 0u; k < 4u; k++) {
            found.cells[k] = (2u * k + 1u) * size / 8u;
            found.shares[k] = 0.25;
        }
        found.count = 4u;
        return found;
    }
    var cell = 1;
    while side > 3.0 * f32(cell) {
        cell *= 2;
    }
    let low = (center - 0.5 * side) / f32(cell);
    let high = (center + 0.5 * side) / f32(cell);
    let first = floor(low);
    found.count = 0u;
    while found.count < 4u {
        let start = first + f32(found.count);
        let share = max((min(high, start + 1.0) - max(low, start)) / (high - low), 0.0);
        if share == 0.0 && found.count > 0u {
            break;
        }
        let texel = (i32(start) * cell + cell / 2) % i32(size);
        found.cells[found.count] = u32(select(texel, texel + i32(size), texel < 0));
        found.shares[found.count] = share;
        found.count++;
    }
    return found;
}

fn decode(sample: f32) -> f32 {
    let s = max(sample, 0.0);
    if coat.encoding == 1u {
        return s;
    }
    if coat.encoding == 2u {
        return coat.floor * (exp(s * coat.range) - 1.0);
    }
    return select(pow((s + 0.055) / 1.055, 2.4), s / 12.92, s <= 0.04045);
}

// Levels 0..=255 of radiance, clamped.
fn displayed(radiance: vec3<f32>) -> vec3<f32> {
    let r = max(radiance * coat.gain, vec3(0.0));
    let encoded = select(1.055 * pow(r, vec3(1.0 / 2.4)) - 0.055, r * 12.92, r <= vec3(0.0031308));
    return 255.0 * min(encoded, vec3(1.0));
}

fn radiance_of(columns: Span, rows: Span, place: Place) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var j = 0u; j < rows.count; j++) {
        for (var i = 0u; i < columns.count; i++) {
            let weight = columns.shares[i] * rows.shares[j];
            if weight > 0.0 {
                let sample = value(rows.cells[j] * coat.size.x + columns.cells[i], place);
                sum += weight * vec3(decode(sample.r), decode(sample.g), decode(sample.b));
            }
        }
    }
    return sum * coat.inverse_exposure;
}

fn radiance(laid: CoatedFace, hit: Hit, is_back: bool) -> vec3<f32> {
    let w = hit.weights;
    let along = laid.tangents[0] * w.x + laid.tangents[1] * w.y + laid.tangents[2] * w.z;
    let upward = laid.normals[0] * w.x + laid.normals[1] * w.y + laid.normals[2] * w.z;
    let height = length(upward.xyz);
    if !(height > 1e-12) {
        return vec3(0.0);
    }
    var tangents = tangent_frame(upward.xyz / height, along.xyz);
    let position = hit.position;
    let to_eye = frame.eye.xyz - position;
    if is_back {
        tangents = TangentFrame(tangents.tangent, -tangents.bitangent, -tangents.normal);
    }
    let scale = laid.tile.x;
    let down = select(-scale, scale, (laid.tile.y == 1.0) == is_back);
    let atlas_area = f32(frame.atlas.x) * f32(frame.atlas.y);
    let side = scale * sqrt(hit.footprint * coat.mesh_atlas.x * coat.mesh_atlas.y / atlas_area);
    let columns = span(scale * coat.mesh_atlas.x * hit.uv.x, side, coat.size.x);
    let rows = span(down * coat.mesh_atlas.y * hit.uv.y, side, coat.size.y);

    var view = local(tangents, to_eye);
    view.z = max(view.z, 0.0);
    let left = length(view);
    view = raised(select(vec3(0.0, 0.0, 1.0), view / left, left > 1e-9), coat.lowest_view);
    var sum = vec3(0.0);
    for (var i = 0u; i < coat.lights; i++) {
        let light = lights[i];
        var toward = light.place.xyz;
        var irradiance = light.irradiance.rgb;
        if light.place.w == 1.0 {
            toward -= position;
            irradiance /= dot(toward, toward);
        }
        let direction = local(tangents, toward);
        var share = direction.z;
        if coat.includes_cosine == 1u {
            share = min(direction.z / coat.lowest_light, 1.0);
        }
        if share > 0.0 {
            let between = place(raised(direction, coat.lowest_light), view);
            sum += irradiance * share * radiance_of(columns, rows, between);
        }
    }
    return sum;
}

@fragment
fn lit(in: Fragment) -> @location(0) vec4<f32> {
    // The outside is seen where the eye lies on the normal's side of the face's plane.
    return vec4(displayed(radiance(coated[in.face], meet(in), in.plane.w > 0.0)), 1.0);
}

// Within 10⁻⁶ of the arctangent, 0 at (0, 0): the language promises less. Hastings, "Approximations for Digital
// Computers", 1955, sheet 13.
fn arctangent(y: f32, x: f32) -> f32 {
    let small = min(abs(x), abs(y));
    let large = max(abs(x), abs(y));
    let t = small / max(large, 1e-37);
    let q = t * t;
    let series = 0.99999933 + q * (-0.33329856 + q * (0.19946536 + q * (-0.13908534
        + q * (0.09642004 + q * (-0.05590989 + q * (0.02186123 - q * 0.004054058))))));
    var angle = t * series;
    angle = select(angle, 1.5707963267948966 - angle, abs(y) > abs(x));
    angle = select(angle, 3.141592653589793 - angle, x < 0.0);
    return select(angle, -angle, y < 0.0);
}
