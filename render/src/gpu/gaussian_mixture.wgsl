// A Gaussian mixture: the colour expected of a texel, light and view; `texture::btf::gaussian_mixture`.
// tables[0]: first component, components, first mean colour, lights. tables[1], tables[2]: lights and views as
// (first number, sites, triangles, border edges). tables[3]: after how many texels x and y begin again, 0 where they do not.

struct Place {
    mean: vec3<f32>,
    // α and s of light, then view.
    angles: vec4<f32>,
}

const COMPONENT = 16u;

fn onion_slice(d: vec3<f32>) -> vec2<f32> {
    return vec2(select(arctangent(d.y, d.z), 0.0, length(d.yz) < 1e-7), d.x);
}

fn place(light: vec3<f32>, view: vec3<f32>) -> Place {
    let lights = blend(coat.tables[1], light);
    let views = blend(coat.tables[2], view);
    var mean = vec3(0.0);
    for (var v = 0u; v < 3u; v++) {
        for (var l = 0u; l < 3u; l++) {
            let pair = views.sites[v] * coat.tables[0].w + lights.sites[l];
            mean += views.weights[v] * lights.weights[l] * triple(coat.tables[0].z + 3u * pair);
        }
    }
    return Place(mean, vec4(onion_slice(light), onion_slice(view)));
}

fn value(texel: u32, place: Place) -> vec3<f32> {
    let at = vec2(f32(texel % coat.size.x), f32(texel / coat.size.x)) + 0.5;
    let period = bitcast<vec2<f32>>(coat.tables[3].xy);
    let inverse = select(vec2(0.0), 1.0 / max(period, vec2(1.0)), period > vec2(0.0));
    var best = -1e30;
    var sum = vec4(0.0);
    for (var m = 0u; m < coat.tables[0].y; m++) {
        let c = coat.tables[0].x + COMPONENT * m;
        // Means and √½/σ of x, y; of light; of view.
        let off = at - pair(c);
        let z = (off - period * round(off * inverse)) * pair(c + 6u);
        let l = (place.angles.xy - pair(c + 2u)) * pair(c + 8u);
        let v = (place.angles.zw - pair(c + 4u)) * pair(c + 10u);
        let log = number(c + 15u) - dot(z, z) - dot(l, l) - dot(v, v);
        if log > best {
            sum *= exp(best - log);
            best = log;
        }
        sum += exp(log - best) * vec4(triple(c + 12u), 1.0);
    }
    return place.mean + sum.rgb / max(sum.w, 1e-30);
}

// Interpolation between measured directions: `texture::directions`.
struct Blend {
    sites: vec3<u32>,
    weights: vec3<f32>,
}

// Set: first number, sites (3 numbers each), triangles (the inverse of their corners, and these: 12), edges (2).
fn blend(directions: vec4<u32>, d: vec3<f32>) -> Blend {
    let triangles = directions.x + 3u * directions.y;
    for (var t = 0u; t < directions.z; t++) {
        let at = triangles + 12u * t;
        let w = vec3(dot(triple(at), d), dot(triple(at + 3u), d), dot(triple(at + 6u), d));
        let sum = w.x + w.y + w.z;
        if sum > 1e-12 && min(w.x, min(w.y, w.z)) >= -1e-5 * sum {
            let weights = max(w, vec3(0.0));
            let sites = vec3(numbers[at + 9u], numbers[at + 10u], numbers[at + 11u]);
            return Blend(sites, weights / (weights.x + weights.y + weights.z));
        }
    }
    return nearest(directions, triangles + 12u * directions.z, d);
}

fn nearest(directions: vec4<u32>, edges: u32, d: vec3<f32>) -> Blend {
    var best = -2.0;
    var found = Blend(vec3(0u), vec3(1.0, 0.0, 0.0));
    for (var i = 0u; i < directions.y; i++) {
        let cosine = dot(triple(directions.x + 3u * i), d);
        if cosine > best {
            best = cosine;
            found = Blend(vec3(i, 0u, 0u), vec3(1.0, 0.0, 0.0));
        }
    }
    for (var e = 0u; e < directions.w; e++) {
        let i = numbers[edges + 2u * e];
        let j = numbers[edges + 2u * e + 1u];
        let a = triple(directions.x + 3u * i);
        let b = triple(directions.x + 3u * j);
        let normal = cross(a, b);
        let sine = length(normal);
        let foot = d - normal * (dot(normal, d) / (sine * sine));
        let along = arctangent(dot(normal, cross(a, foot)) / sine, dot(a, foot));
        let span = arctangent(sine, dot(a, b));
        let cosine = dot(foot, d) / length(foot);
        if sine > 1e-6 && along >= 0.0 && along <= span && cosine > best {
            best = cosine;
            found = Blend(vec3(i, j, 0u), vec3(1.0 - along / span, along / span, 0.0));
        }
    }
    return found;
}
