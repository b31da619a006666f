// The rays of a texel blended by their angle to the eye: w = (1 − pen/threshold)/pen of the four nearest, the fifth the
// threshold. Alpha 1 where there are rays.
@group(0) @binding(0) var colors: texture_2d_array<f32>;
@group(0) @binding(1) var views: texture_2d_array<u32>;
// Surface points, relative to the middle of the mesh; w 0 where there is none.
@group(0) @binding(2) var points: texture_2d<f32>;
@group(0) @binding(3) var<storage, read> centers: array<vec4<f32>>;
@group(0) @binding(4) var<uniform> eye: vec4<f32>;

const BLENDED = 4u;
const NO_RAY = 65535u;

@fragment
fn blend(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let texel = vec2<u32>(at.xy);
    let point = textureLoad(points, texel, 0);
    let toward = eye.xyz - point.xyz;
    if point.w == 0.0 || dot(toward, toward) == 0.0 {
        return vec4(0.0);
    }
    let to_eye = normalize(toward);
    // Nearest first.
    var penalties = array<f32, 5>(1e30, 1e30, 1e30, 1e30, 1e30);
    var nearest = array<vec3<f32>, 5>();
    var count = 0u;
    for (var k = 0u; k < textureNumLayers(views); k++) {
        let view = textureLoad(views, texel, k, 0).r;
        if view == NO_RAY {
            continue;
        }
        count++;
        var penalty = length(normalize(centers[view].xyz - point.xyz) - to_eye);
        var color = textureLoad(colors, texel, k, 0).rgb;
        for (var i = 0u; i <= BLENDED; i++) {
            if penalty < penalties[i] {
                let other = penalties[i];
                let other_color = nearest[i];
                penalties[i] = penalty;
                nearest[i] = color;
                penalty = other;
                color = other_color;
            }
        }
    }
    if count == 0u {
        return vec4(0.0);
    }
    var threshold = penalties[BLENDED];
    if count <= BLENDED {
        threshold = 1.01 * penalties[count - 1u];
    }
    threshold += 1e-12;
    var sum = vec4(0.0);
    for (var i = 0u; i < min(count, BLENDED); i++) {
        let weight = max(1.0 - penalties[i] / threshold, 0.0) / max(penalties[i], 1e-6) + 1e-9;
        sum += weight * vec4(nearest[i], 1.0);
    }
    return vec4(255.0 * sum.rgb / sum.w, 1.0);
}
