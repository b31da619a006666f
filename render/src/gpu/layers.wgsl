// Layers blended texel by texel: each with the weights of its facet.
@group(0) @binding(0) var layers: texture_2d_array<f32>;
@group(0) @binding(1) var facets: texture_2d<u32>;
// Per facet: (bias, how many terms), then (gain, layer) of each.
@group(0) @binding(2) var<storage, read> weights: array<vec2<f32>>;
// x: entries a facet.
@group(0) @binding(3) var<uniform> row: vec4<u32>;

@fragment
fn blend(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let texel = vec2<u32>(at.xy);
    let start = textureLoad(facets, texel, 0).r * row.x;
    let head = weights[start];
    var sum = vec3(head.x);
    for (var i = start + 1u; i <= start + u32(head.y); i++) {
        let term = weights[i];
        sum += term.x * textureLoad(layers, texel, u32(term.y), 0).rgb;
    }
    return vec4(sum, 1.0);
}
