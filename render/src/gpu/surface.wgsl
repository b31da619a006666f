// Where a sub-sample's ray meets its face, and the texture there. Positions are relative to the middle of the mesh;
// the hit is that of the ray with the face's plane, so that it does not depend on how the hardware interpolates.

struct Frame {
    clip_from_object: mat4x4<f32>,
    // Directions of the camera's axes in the object's coordinates; w unused.
    right: vec4<f32>,
    down: vec4<f32>,
    forward: vec4<f32>,
    eye: vec4<f32>,
    // 1/fx, 1/fy, skew, pixels from one sub-sample to the next.
    pinhole: vec4<f32>,
    // Principal point in pixels of the tile; zw unused.
    center: vec4<f32>,
    // Texels across and down, coarsest mip level; w unused.
    atlas: vec4<u32>,
}

struct Face {
    // The first corner.
    corner: vec4<f32>,
    // Unit, outward.
    normal: vec4<f32>,
    // Gradients over the plane of the weights of the second and third corner.
    second: vec4<f32>,
    third: vec4<f32>,
    // Texture coordinates of the first corner; zw unused.
    uv: vec4<f32>,
    // From the first corner to the second (xy) and third (zw), in texture coordinates.
    edges: vec4<f32>,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> faces: array<Face>;
@group(0) @binding(2) var atlas: texture_2d<f32>;

struct Fragment {
    @builtin(position) at: vec4<f32>,
    @location(0) @interpolate(flat) face: u32,
}

@vertex
fn project(@location(0) position: vec3<f32>, @location(1) face: u32) -> Fragment {
    return Fragment(frame.clip_from_object * vec4(position, 1.0), face);
}

struct Hit {
    // Of the three corners.
    weights: vec3<f32>,
    position: vec3<f32>,
    // Texture coordinates.
    uv: vec2<f32>,
    // Longer side of the sub-sample's footprint in texels of the atlas, squared.
    footprint: f32,
}

fn meet(face: Face, at: vec2<f32>) -> Hit {
    let pixel = at * frame.pinhole.w - frame.center.xy;
    let y = pixel.y * frame.pinhole.y;
    let x = (pixel.x - frame.pinhole.z * y) * frame.pinhole.x;
    let direction = frame.right.xyz * x + frame.down.xyz * y + frame.forward.xyz;
    let from_eye = face.corner.xyz - frame.eye.xyz;
    let cosine = dot(face.normal.xyz, direction);
    let depth = dot(face.normal.xyz, from_eye) / cosine;
    let along = depth * direction - from_eye;
    let second = dot(face.second.xyz, along);
    let third = dot(face.third.xyz, along);
    // Hardware snaps corners to a grid: what it takes for inside may lie a little outside, or far on a grazing face.
    var weights = max(vec3(1.0 - second - third, second, third), vec3(0.0));
    weights /= max(weights.x + weights.y + weights.z, 1e-30);

    let across = frame.right.xyz * (frame.pinhole.w * frame.pinhole.x);
    let down = frame.down.xyz * (frame.pinhole.w * frame.pinhole.y) - across * (frame.pinhole.z * frame.pinhole.y);
    let u = texels_moved(face, direction, cosine, depth, across);
    let v = texels_moved(face, direction, cosine, depth, down);
    let uv = face.uv.xy + weights.y * face.edges.xy + weights.z * face.edges.zw;
    return Hit(weights, face.corner.xyz + along, uv, max(dot(u, u), dot(v, v)));
}

// How far the hit moves over the atlas when the ray's direction changes: dP = t (dD − D (N·dD)/(N·D)).
fn texels_moved(face: Face, direction: vec3<f32>, cosine: f32, depth: f32, change: vec3<f32>) -> vec2<f32> {
    let moved = depth * (change - direction * (dot(face.normal.xyz, change) / cosine));
    let uv = dot(face.second.xyz, moved) * face.edges.xy + dot(face.third.xyz, moved) * face.edges.zw;
    return uv * vec2<f32>(frame.atlas.xy);
}

// One level, borders repeated; levels are rounded up.
fn bilinear(place: vec2<f32>, level: u32) -> vec3<f32> {
    let size = (frame.atlas.xy + ((1u << level) - 1u)) >> vec2(level);
    let at = clamp(place * exp2(-f32(level)) - 0.5, vec2(0.0), vec2<f32>(size - 1u));
    let first = vec2<u32>(at);
    let next = min(first + 1u, size - 1u);
    let t = at - vec2<f32>(first);
    let l = i32(level);
    let above = mix(textureLoad(atlas, first, l).rgb, textureLoad(atlas, vec2(next.x, first.y), l).rgb, t.x);
    let below = mix(textureLoad(atlas, vec2(first.x, next.y), l).rgb, textureLoad(atlas, next, l).rgb, t.x);
    return mix(above, below, t.y);
}

// Trilinear; `place` in texels of level 0. Levels are mixed here, for hardware may take short cuts.
fn filtered(place: vec2<f32>, footprint: f32) -> vec3<f32> {
    let level = min(select(0.0, 0.5 * log2(footprint), footprint > 1.0), f32(frame.atlas.z));
    if level < 1.0 / 256.0 {
        return bilinear(place, 0u);
    }
    let fine = u32(level);
    let coarse = min(fine + 1u, frame.atlas.z);
    return mix(bilinear(place, fine), bilinear(place, coarse), level - f32(fine));
}

@fragment
fn show(in: Fragment) -> @location(0) vec4<f32> {
    let hit = meet(faces[in.face], in.at.xy);
    return vec4(filtered(hit.uv * vec2<f32>(frame.atlas.xy), hit.footprint), 1.0);
}
