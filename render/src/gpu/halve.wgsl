// One mip level out of the finer one: the mean of 2 × 2 texels, the last column and row repeated where a side is odd.
@group(0) @binding(0) var fine: texture_2d<f32>;
// Texels of the finer level that are used, across and down.
@group(0) @binding(1) var<uniform> fine_size: vec4<u32>;

@fragment
fn halve(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let first = 2u * vec2<u32>(at.xy);
    let next = min(first + 1u, fine_size.xy - 1u);
    let above = textureLoad(fine, first, 0) + textureLoad(fine, vec2(next.x, first.y), 0);
    let below = textureLoad(fine, vec2(first.x, next.y), 0) + textureLoad(fine, next, 0);
    return 0.25 * (above + below);
}
