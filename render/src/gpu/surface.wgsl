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

// What is the same all over a face comes from its corners, so that sub-samples need not look it up. Over the image
// plane's q = (x, y, 1): dot(xyz, q) and w.
struct Fragment {
    @builtin(position) at: vec4<f32>,
    @location(0) @interpolate(flat) face: u32,
    // 1 / depth is dot / w.
    @location(1) @interpolate(flat) plane: vec4<f32>,
    // The weights of the second and third corner are depth · dot − w.
    @location(2) @interpolate(flat) second: vec4<f32>,
    @location(3) @interpolate(flat) third: vec4<f32>,
    // Texture coordinates of the first corner, and from there to the others.
    @location(4) @interpolate(flat) uv: vec2<f32>,
    @location(5) @interpolate(flat) edges: vec4<f32>,
}

@vertex
fn project(@location(0) position: vec3<f32>, @location(1) index: u32) -> Fragment {
    let face = faces[index];
    let from_eye = face.corner.xyz - frame.eye.xyz;
    return Fragment(
        frame.clip_from_object * vec4(position, 1.0),
        index,
        over_plane(face.normal.xyz, from_eye),
        over_plane(face.second.xyz, from_eye),
        over_plane(face.third.xyz, from_eye),
        face.uv.xy,
        face.edges,
    );
}

fn over_plane(v: vec3<f32>, from_eye: vec3<f32>) -> vec4<f32> {
    return vec4(dot(v, frame.right.xyz), dot(v, frame.down.xyz), dot(v, frame.forward.xyz), dot(v, from_eye));
}

struct Hit {
    // Of the three corners.
    weights: vec3<f32>,
    // Texture coordinates.
    uv: vec2<f32>,
    // Longer side of the sub-sample's footprint in texels of the atlas, squared.
    footprint: f32,
    position: vec3<f32>,
}

fn meet(in: Fragment) -> Hit {
    let pixel = in.at.xy * frame.pinhole.w - frame.center.xy;
    let y = pixel.y * frame.pinhole.y;
    let q = vec3((pixel.x - frame.pinhole.z * y) * frame.pinhole.x, y, 1.0);
    let cosine = dot(in.plane.xyz, q);
    let depth = in.plane.w / cosine;
    let slopes = vec2(dot(in.second.xyz, q), dot(in.third.xyz, q));
    let others = depth * slopes - vec2(in.second.w, in.third.w);
    // Hardware snaps corners to a grid: what it takes for inside may lie a little outside, or far on a grazing face.
    var weights = max(vec3(1.0 - others.x - others.y, others), vec3(0.0));
    weights /= max(weights.x + weights.y + weights.z, 1e-30);

    // From one sub-sample to the next q moves by these; dw = t (dq·W − (q·W)(dq·N)/(q·N)).
    let across = vec2(frame.pinhole.w * frame.pinhole.x, 0.0);
    let down = vec2(-frame.pinhole.z * across.x, frame.pinhole.w) * frame.pinhole.y;
    let u = texels_moved(in, slopes / cosine, depth, across);
    let v = texels_moved(in, slopes / cosine, depth, down);
    let uv = in.uv + weights.y * in.edges.xy + weights.z * in.edges.zw;
    let direction = frame.right.xyz * q.x + frame.down.xyz * q.y + frame.forward.xyz;
    return Hit(weights, uv, max(dot(u, u), dot(v, v)), frame.eye.xyz + depth * direction);
}

// How far the hit moves over the atlas.
fn texels_moved(in: Fragment, slopes: vec2<f32>, depth: f32, change: vec2<f32>) -> vec2<f32> {
    let weights = vec2(dot(in.second.xy, change), dot(in.third.xy, change)) - slopes * dot(in.plane.xy, change);
    return depth * (weights.x * in.edges.xy + weights.y * in.edges.zw) * vec2<f32>(frame.atlas.xy);
}

// One level, borders repeated; levels are rounded up. Hardware may take short cuts with weights and levels (Mesa's
// takes one level for four pixels), so texels are mixed here.
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

// Trilinear; `place` in texels of level 0.
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
    let hit = meet(in);
    return vec4(filtered(hit.uv * vec2<f32>(frame.atlas.xy), hit.footprint), 1.0);
}
