// Watertight ray-triangle test: Woop, Benthin, Wald, "Watertight ray/triangle
// intersection", JCGT 2(1), 2013. Counterpart: `sim-gpu/src/cpu/intersect.rs`.
//
// Two triangles that share an edge must get exactly opposite values of its
// edge function. Corners come in canonical order, so a shared edge is always
// evaluated on the same endpoints in the same order; and every product that
// could be contracted is spelled as fma(), so that a compiler has no choice to
// make differently in two places.

// Rows of the shear that maps the ray onto +z.
struct Shear {
    x: vec3f,
    y: vec3f,
    z: vec3f,
}

fn shear_of(direction: vec3f) -> Shear {
    let size = abs(direction);
    let along_x = size.x > size.y && size.x > size.z;
    let along_y = !along_x && size.y > size.z;
    var ex = vec3f(1.0, 0.0, 0.0);
    var ey = vec3f(0.0, 1.0, 0.0);
    var ez = vec3f(0.0, 0.0, 1.0);
    var d = direction;
    if along_x {
        ex = vec3f(0.0, 1.0, 0.0);
        ey = vec3f(0.0, 0.0, 1.0);
        ez = vec3f(1.0, 0.0, 0.0);
        d = direction.yzx;
    } else if along_y {
        ex = vec3f(0.0, 0.0, 1.0);
        ey = vec3f(1.0, 0.0, 0.0);
        ez = vec3f(0.0, 1.0, 0.0);
        d = direction.zxy;
    }
    let per_z = 1.0 / d.z;
    return Shear(ex - ez * (d.x * per_z), ey - ez * (d.y * per_z), ez * per_z);
}

fn row(r: vec3f, p: vec3f) -> f32 {
    return fma(r.z, p.z, fma(r.y, p.y, r.x * p.x));
}

fn edge(px: f32, py: f32, qx: f32, qy: f32) -> f32 {
    return fma(px, qy, -(py * qx));
}

struct Candidate {
    hit: bool,
    t: f32,
    error: f32,
    rival: f32,
}

fn within(edge: f32, x: f32, y: f32) -> bool {
    return edge * edge <= DISPLACEMENT * DISPLACEMENT * (x * x + y * y);
}

fn intersect(origin: vec3f, shear: Shear, triangle: LeafTriangle) -> Candidate {
    let a = triangle.a - origin;
    let b = triangle.b - origin;
    let c = triangle.c - origin;
    let ax = row(shear.x, a);
    let ay = row(shear.y, a);
    let bx = row(shear.x, b);
    let by = row(shear.y, b);
    let cx = row(shear.x, c);
    let cy = row(shear.y, c);
    let u = edge(bx, by, cx, cy);
    let v = -edge(ax, ay, cx, cy);
    let w = edge(ax, ay, bx, by);
    let least = min(min(u, v), w);
    let most = max(max(u, v), w);
    // A ray within DISPLACEMENT of the triangle is outside no side by more than this: the shear makes
    // a side at most sqrt(3) longer.
    let margin = 2.0 * DISPLACEMENT * triangle.longest;
    if least < -margin && most > margin {
        return Candidate(false, 0.0, 0.0, NO_HIT);
    }
    let near_u = within(u, cx - bx, cy - by);
    let near_v = within(v, cx - ax, cy - ay);
    let near_w = within(w, bx - ax, by - ay);
    // Outside by the sides that the ray is not near.
    let left = (u < 0.0 && !near_u) || (v < 0.0 && !near_v) || (w < 0.0 && !near_w);
    let right = (u > 0.0 && !near_u) || (v > 0.0 && !near_v) || (w > 0.0 && !near_w);
    if left && right {
        return Candidate(false, 0.0, 0.0, NO_HIT);
    }
    let az = row(shear.z, a);
    let bz = row(shear.z, b);
    let cz = row(shear.z, c);
    let determinant = u + v + w;
    // A triangle seen edge-on is met anywhere along its extent.
    var t = min(min(az, bz), cz);
    let extent = max(max(az, bz), cz) - t;
    var error = DISPLACEMENT + extent;
    if determinant != 0.0 {
        t = fma(w, cz, fma(v, bz, u * az)) / determinant;
        // The normal in sheared space has the determinant as its z: their ratio is
        // the tangent that turns a displacement into an error of distance.
        let slope_x = edge(by - ay, bz - az, cy - ay, cz - az);
        let slope_y = edge(bz - az, bx - ax, cz - az, cx - ax);
        let slope = (abs(slope_x) + abs(slope_y)) / abs(determinant);
        let rounding = EDGE_ROUNDING * triangle.longest * triangle.longest * extent / abs(determinant);
        error = DISPLACEMENT * (1.0 + slope) + rounding;
    }
    // Near an edge the ray may truly miss the triangle; a triangle within its error of the origin
    // may truly lie behind it.
    let is_open = near_u || near_v || near_w || t < error;
    return Candidate(t + error >= 0.0, t, error, select(NO_HIT, t - error, is_open));
}
