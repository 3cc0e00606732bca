// Finds the nearest triangle along a ray. Counterpart: `sim-gpu/src/cpu/traverse.rs`.

fn reciprocal(direction: vec3f) -> vec3f {
    let away = select(vec3f(-LEAST_COMPONENT), vec3f(LEAST_COMPONENT), direction >= vec3f(0.0));
    return 1.0 / select(direction, away, abs(direction) < vec3f(LEAST_COMPONENT));
}

// A ray prepared for slab tests: it meets the plane at x at distance x * per_direction + offset.
// Rounding the offset moves the plane by at most 2 * 2^-24, for which boxes are padded.
struct Slabs {
    per_direction: vec3f,
    offset: vec3f,
}

// The distance at which the ray enters the box, or NO_HIT.
fn enter(low: vec3f, high: vec3f, slabs: Slabs, farthest: f32) -> f32 {
    let t0 = fma(low, slabs.per_direction, slabs.offset);
    let t1 = fma(high, slabs.per_direction, slabs.offset);
    let nearer = min(t0, t1);
    let farther = max(t0, t1);
    let near = max(max(nearer.x, nearer.y), max(nearer.z, 0.0));
    let far = min(min(farther.x, farther.y), min(farther.z, farthest)) * FAR_SCALE;
    return select(NO_HIT, near, near <= far);
}

fn consider(nearest: ptr<function, Nearest>, candidate: Candidate, leaf: u32, index: u32) {
    if !candidate.hit {
        return;
    }
    let best = *nearest;
    let wins = candidate.t < best.t || (candidate.t == best.t && index < best.index);
    let loser = select(candidate.t - candidate.error, best.t - best.error, wins);
    (*nearest).rival = min(min(best.rival, loser), candidate.rival);
    (*nearest).farthest = min(best.farthest, candidate.t + candidate.error);
    if wins {
        (*nearest).t = candidate.t;
        (*nearest).error = candidate.error;
        (*nearest).leaf = leaf;
        (*nearest).index = index;
    }
}

fn scan_leaf(nearest: ptr<function, Nearest>, first: u32, count: u32, origin: vec3f, shear: Shear) {
    for (var leaf = first; leaf < first + count; leaf++) {
        let triangle = triangles[leaf];
        consider(nearest, intersect(origin, shear, triangle), leaf, triangle.index);
    }
}

fn traverse(ray: TraceRay) -> Nearest {
    let shear = shear_of(ray.direction);
    let per_direction = reciprocal(ray.direction);
    let slabs = Slabs(per_direction, -(ray.origin * per_direction));
    var nearest = Nearest(NO_HIT, 0.0, 0u, MISS, NO_HIT, NO_HIT);
    var stack: array<u32, STACK_SIZE>;
    var height = 0u;
    var at = ray.root;
    loop {
        let node = nodes[at];
        var left = enter(node.left_min, node.left_max, slabs, nearest.farthest);
        var right = enter(node.right_min, node.right_max, slabs, nearest.farthest);
        if left < NO_HIT && node.left_count > 0u {
            scan_leaf(&nearest, node.left, node.left_count, ray.origin, shear);
            left = NO_HIT;
        }
        if right < NO_HIT && node.right_count > 0u {
            scan_leaf(&nearest, node.right, node.right_count, ray.origin, shear);
            right = NO_HIT;
        }
        let left_first = left <= right;
        let near = min(left, right);
        let far = max(left, right);
        if near < NO_HIT {
            at = select(node.right, node.left, left_first);
            if far < NO_HIT {
                stack[height] = select(node.left, node.right, left_first);
                height += 1u;
            }
        } else {
            if height == 0u {
                break;
            }
            height -= 1u;
            at = stack[height];
        }
    }
    return nearest;
}

// The caster's answer; ambiguous if the rival may truly be nearer.
fn code_of(nearest: Nearest) -> u32 {
    let is_open = nearest.index != MISS && nearest.t + nearest.error > nearest.rival;
    return nearest.index | select(0u, AMBIGUOUS, is_open);
}
