use std::sync::{Condvar, Mutex, PoisonError};

/// The bytes that meshes in progress may hold together.
#[derive(Debug)]
pub struct Budget {
    limit: u64,
    held: Mutex<u64>,
    released: Condvar,
}

/// A share of a budget, which is returned when it is dropped.
#[derive(Debug)]
pub struct Share<'a> {
    budget: &'a Budget,
    bytes: u64,
}

impl Budget {
    #[must_use]
    pub fn new(limit: u64) -> Self {
        Self { limit, held: Mutex::new(0), released: Condvar::new() }
    }

    /// Waits until `bytes` are free. A share that exceeds the whole budget is granted when nothing
    /// else is held, so that the largest mesh passes as well.
    pub fn take(&self, bytes: u64) -> Share<'_> {
        let held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        let full = |held: &mut u64| *held > 0 && *held + bytes > self.limit;
        let mut held = self.released.wait_while(held, full).unwrap_or_else(PoisonError::into_inner);
        *held += bytes;
        Share { budget: self, bytes }
    }
}

impl Drop for Share<'_> {
    fn drop(&mut self) {
        *self.budget.held.lock().unwrap_or_else(PoisonError::into_inner) -= self.bytes;
        self.budget.released.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering::SeqCst};

    #[test]
    fn only_a_single_share_exceeds_the_budget() {
        let budget = Budget::new(10);
        let (held, worst) = (AtomicU64::new(0), AtomicU64::new(0));
        std::thread::scope(|threads| {
            for bytes in [3, 4, 5, 25, 6, 2, 9, 1] {
                let (budget, held, worst) = (&budget, &held, &worst);
                threads.spawn(move || {
                    let _share = budget.take(bytes);
                    let now = held.fetch_add(bytes, SeqCst) + bytes;
                    worst.fetch_max(if now == 25 { 0 } else { now }, SeqCst);
                    std::thread::yield_now();
                    held.fetch_sub(bytes, SeqCst);
                });
            }
        });
        assert!(worst.load(SeqCst) <= 10, "{worst:?}");
    }
}
