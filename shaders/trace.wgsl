// Traces one ray per invocation: the code of the nearest triangle, and the outputs of effects.
// Counterpart: `sim-gpu/src/cpu/trace.rs`.

@group(0) @binding(0) var<storage, read> nodes: array<Node>;
@group(0) @binding(1) var<storage, read> triangles: array<LeafTriangle>;
// One word for each ray that is made here, its beam; eight, a `TraceRay`, for each that is sent.
@group(0) @binding(2) var<storage, read> rays: array<u32>;
@group(0) @binding(3) var<storage, read_write> codes: array<u32>;
// Sorted by first ray.
@group(0) @binding(4) var<storage, read> views: array<View>;
// Three words for each beam of a pattern.
@group(0) @binding(5) var<storage, read> directions: array<i32>;
// Batches of different sizes reuse the buffers, so that array lengths do not give the number of
// elements.
struct Counts {
    rays: u32,
    views: u32,
}
@group(0) @binding(6) var<uniform> counts: Counts;

// The view of ray `i`: the last whose first ray is not after it.
fn view_of(i: u32) -> View {
    var low = 0u;
    var high = counts.views;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if views[middle].first_ray <= i {
            low = middle;
        } else {
            high = middle;
        }
    }
    return views[low];
}

fn sent_vector(at: u32) -> vec3f {
    return bitcast<vec3f>(vec3u(rays[at], rays[at + 1u], rays[at + 2u]));
}

fn ray_of(i: u32) -> TraceRay {
    let view = view_of(i);
    let number = i - view.first_ray;
    if view.first_direction == SENT {
        let at = view.first_word + 8u * number;
        let root = view.root + rays[at + 3u];
        return TraceRay(sent_vector(at), root, sent_vector(at + 4u), 0u);
    }
    let at = 3u * (view.first_direction + rays[view.first_word + number]);
    return aim(view, vec3i(directions[at], directions[at + 1u], directions[at + 2u]));
}

@compute @workgroup_size(WORKGROUP_SIZE)
fn main(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = (workgroup.y * workgroups.x + workgroup.x) * WORKGROUP_SIZE + lane;
    if i >= counts.rays {
        return;
    }
    let ray = ray_of(i);
    let nearest = traverse(ray);
    codes[i] = code_of(nearest);
    finish(i, ray, nearest);
}
