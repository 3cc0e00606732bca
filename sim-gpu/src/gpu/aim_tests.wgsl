@group(0) @binding(0) var<storage, read> views: array<View>;
@group(0) @binding(1) var<storage, read> beams: array<vec3i>;
@group(0) @binding(2) var<storage, read_write> made: array<TraceRay>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x < arrayLength(&views) {
        made[id.x] = aim(views[id.x], beams[id.x]);
    }
}
