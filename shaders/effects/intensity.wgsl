// |cos(incidence)| times the object's reflectivity: BLAINDER's model. Counterpart:
// `sim-gpu/src/cpu/effects.rs`.

fn intensity(i: u32, ray: TraceRay, nearest: Nearest) -> f32 {
    let triangle = triangles[nearest.leaf];
    // Slivers and tiny triangles: scaled so that the product cannot underflow.
    var e1 = triangle.b - triangle.a;
    var e2 = triangle.c - triangle.a;
    e1 /= max(max(abs(e1.x), abs(e1.y)), abs(e1.z));
    e2 /= max(max(abs(e2.x), abs(e2.y)), abs(e2.z));
    let normal = cross(e1, e2);
    let cosine = abs(dot(normal, ray.direction)) / length(normal);
    return min(cosine, 1.0) * view_of(i).reflectivity;
}
