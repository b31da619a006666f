// Texels without rays take what surrounds them, as `geometry::atlas::PushPull`: alpha 1 is known.
@group(0) @binding(0) var fine: texture_2d<f32>;
@group(0) @binding(1) var coarse: texture_2d<f32>;

// The mean of the known among 2 × 2.
@fragment
fn push(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let size = textureDimensions(fine);
    let first = 2u * vec2<u32>(at.xy);
    var sum = vec4(0.0);
    for (var i = 0u; i < 4u; i++) {
        let child = first + vec2(i & 1u, i >> 1u);
        if all(child < size) {
            sum += textureLoad(fine, child, 0);
        }
    }
    return sum / max(sum.a, 1.0);
}

// What is unknown takes 9, 3, 3 and 1 sixteenths of the level above.
@fragment
fn pull(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let texel = vec2<u32>(at.xy);
    let own = textureLoad(fine, texel, 0);
    if own.a > 0.5 {
        return own;
    }
    let last = vec2<i32>(textureDimensions(coarse)) - 1;
    let near = vec2<i32>(texel) / 2;
    let far = clamp(near + 2 * (vec2<i32>(texel) & vec2(1)) - 1, vec2(0), last);
    var sum = 9.0 * textureLoad(coarse, near, 0);
    sum += 3.0 * (textureLoad(coarse, vec2(far.x, near.y), 0) + textureLoad(coarse, vec2(near.x, far.y), 0));
    sum += textureLoad(coarse, far, 0);
    return vec4(sum.rgb / 16.0, 1.0);
}
