// From sub-samples to pixels: the mean of the covered ones, clamped and rounded once.

struct Resolve {
    // Levels 0..=255; w 1 where there is one.
    background: vec4<f32>,
    // Pixel of the target that is the tile's first.
    origin: vec2<u32>,
    per_side: u32,
    // 1 where the target encodes sRGB by itself.
    is_srgb: u32,
}

@group(0) @binding(0) var samples: texture_2d<f32>;
@group(0) @binding(1) var<uniform> options: Resolve;

@fragment
fn resolve(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let first = (vec2<u32>(at.xy) - options.origin) * options.per_side;
    var sum = vec4(0.0);
    for (var y = 0u; y < options.per_side; y++) {
        for (var x = 0u; x < options.per_side; x++) {
            sum += textureLoad(samples, first + vec2(x, y), 0);
        }
    }
    let count = f32(options.per_side * options.per_side);
    var pixel = vec4(sum.rgb / max(sum.a, 1.0), 255.0 * sum.a / count);
    if options.background.w > 0.0 {
        pixel = vec4((sum.rgb + (count - sum.a) * options.background.rgb) / count, 255.0);
    }
    let shown = floor(clamp(pixel, vec4(0.0), vec4(255.0)) + 0.5) / 255.0;
    return select(shown, vec4(linear(shown.rgb), shown.a), options.is_srgb == 1u);
}

fn linear(encoded: vec3<f32>) -> vec3<f32> {
    return select(pow((encoded + 0.055) / 1.055, vec3(2.4)), encoded / 12.92, encoded <= vec3(0.04045));
}
