// One ray per invocation: the nearest triangle's code, and what the effects
// asked for. Counterpart: `sim-gpu/src/cpu/trace.rs`.

@group(0) @binding(0) var<storage, read> nodes: array<Node>;
@group(0) @binding(1) var<storage, read> triangles: array<LeafTriangle>;
@group(0) @binding(2) var<storage, read> rays: array<TraceRay>;
@group(0) @binding(3) var<storage, read_write> codes: array<u32>;
// Buffers are used again by batches of other sizes, so their lengths do not tell
// how many rays there are. This number comes with each dispatch, so that the
// bindings stay as they are.
var<immediate> ray_count: u32;

@compute @workgroup_size(WORKGROUP_SIZE)
fn main(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = (workgroup.y * workgroups.x + workgroup.x) * WORKGROUP_SIZE + lane;
    if i >= ray_count {
        return;
    }
    let ray = rays[i];
    let nearest = traverse(ray);
    codes[i] = code_of(nearest, ray.skipped);
    finish(i, ray, nearest);
}
