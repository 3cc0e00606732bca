//! Tasks that upload their tars over one link.

/// Tars that are simulated of each task. The first half is not counted.
const TARS: usize = 40;

/// What a task does, and for how long it would still do so if it were alone.
struct Task {
    uploads: bool,
    left_s: f64,
}

/// The rate of `tasks` tasks as a share of their rate without a link. Each casts a tar in `cast_s`
/// seconds, and then uploads it, which takes `upload_s` seconds if no other task uploads; those that
/// upload together have equal shares of the link. Each task starts `stagger_s` after the one before.
pub fn share_of_rate(tasks: usize, cast_s: f64, upload_s: f64, stagger_s: f64) -> f64 {
    let start = |i| Task { uploads: false, left_s: cast_s + stagger_s * i as f64 };
    let mut all: Vec<Task> = (0..tasks).map(start).collect();
    let (mut now_s, mut done, mut counted_from) = (0.0, 0, None);
    while done < TARS * tasks {
        let uploading = all.iter().filter(|task| task.uploads).count() as f64;
        let slowed = |task: &Task| if task.uploads { uploading } else { 1.0 };
        let step_s = all.iter().map(|task| task.left_s * slowed(task)).fold(f64::MAX, f64::min);
        now_s += step_s;
        for task in &mut all {
            task.left_s -= step_s / slowed(task);
            if task.left_s < 1e-9 {
                done += usize::from(task.uploads);
                let next_s = if task.uploads { cast_s } else { upload_s };
                *task = Task { uploads: !task.uploads, left_s: next_s };
            }
        }
        if done >= TARS * tasks / 2 {
            counted_from.get_or_insert((now_s, done));
        }
    }
    let (from_s, from) = counted_from.unwrap_or_default();
    (done - from) as f64 / (now_s - from_s) * cast_s / tasks as f64
}

#[cfg(test)]
mod tests {
    use super::share_of_rate;

    #[test]
    fn few_tasks_do_not_share_the_link_and_many_fill_it() {
        let (cast_s, upload_s) = (12.0, 0.7);
        for tasks in [1, 2, 8, 64, 256] {
            let n = tasks as f64;
            let staggered_per_s = (n / (cast_s + upload_s)).min(1.0 / upload_s);
            let together_per_s = n / (cast_s + n * upload_s);
            for (stagger_s, tars_per_s) in [(cast_s / n, staggered_per_s), (0.0, together_per_s)] {
                let found = share_of_rate(tasks, cast_s, upload_s, stagger_s);
                // Of the 20 rounds that are counted, one may be cut.
                let ratio = found / (tars_per_s * cast_s / n);
                assert!((ratio - 1.0).abs() < 0.05, "{tasks} tasks, {stagger_s} s: {ratio}");
            }
        }
    }
}
