//! A team of threads that divides one task at a time into chunks.
//!
//! Free threads, including the caller, claim chunks one by one. If another process holds a core,
//! the other threads do its share, and the caller never waits for a thread that has claimed
//! nothing. A long wait for a claimed chunk means that its worker has lost its core: the caller
//! then works alone for a while ([`Backoff`]), so that a busy neighbour costs no more than the team
//! gains. Idle threads spin briefly, because the next task of a frame is microseconds away, and
//! then park, because the next frame is not.

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// How long an idle worker spins: the length of a few tasks, and at most the cost of a wake-up.
const SPIN: Duration = Duration::from_micros(40);

/// A wait for a worker is long if it exceeds this many times the duration of a chunk, plus
/// [`LONG_WAIT`].
const LONG_WAIT_CHUNKS: u32 = 3;
/// More than the duration of a wake-up.
const LONG_WAIT: Duration = Duration::from_micros(200);

/// A kind of task that consists of chunks.
pub trait Work: Send + Sync + 'static {
    /// Does chunk number `chunk` of the current task. `thread` numbers the threads of the team, the
    /// caller being 0.
    fn chunk(&self, thread: usize, chunk: usize);
}

/// Threads that process the chunks of `W`.
pub struct Team<W: Work> {
    work: Arc<W>,
    queue: Arc<TaskQueue>,
    workers: Vec<JoinHandle<()>>,
    backoff: Mutex<Backoff>,
}

/// When the caller works alone: for a while after a long wait, twice as long after each further
/// one, and half as long after many tasks without one.
struct Backoff {
    until: Option<Instant>,
    length: Duration,
    good_tasks: u32,
}

impl Backoff {
    const SHORTEST: Duration = Duration::from_millis(20);
    const LONGEST: Duration = Duration::from_secs(1);
    /// About ten frames.
    const GOOD_TASKS: u32 = 200;

    fn new() -> Self {
        Self { until: None, length: Self::SHORTEST, good_tasks: 0 }
    }

    fn is_on(&mut self, now: Instant) -> bool {
        let is_on = self.until.is_some_and(|until| now < until);
        if !is_on {
            self.until = None;
        }
        is_on
    }

    fn note(&mut self, long_wait: bool, now: Instant) {
        if long_wait {
            self.until = Some(now + self.length);
            self.length = (self.length * 2).min(Self::LONGEST);
            self.good_tasks = 0;
            return;
        }
        self.good_tasks += 1;
        if self.good_tasks == Self::GOOD_TASKS {
            self.length = (self.length / 2).max(Self::SHORTEST);
            self.good_tasks = 0;
        }
    }
}

/// The state that the threads share.
struct TaskQueue {
    /// The number of the task (32 bits), of its chunks (16) and of the next chunk to claim (16).
    /// They are one word, so that a claim cannot mix two tasks.
    ticket: AtomicU64,
    /// The number of finished chunks of the current task.
    done: AtomicU32,
    started: AtomicU32,
    /// Which workers sleep.
    parked: Vec<AtomicBool>,
    stop: AtomicBool,
}

/// The largest number of chunks of a task.
pub const MOST_CHUNKS: usize = u16::MAX as usize;

impl<W: Work> Team<W> {
    /// A team of `n_threads`, one of which is the caller of [`Team::run`].
    pub fn new(work: W, n_threads: usize) -> std::io::Result<Self> {
        let n_workers = n_threads.max(1) - 1;
        let work = Arc::new(work);
        let queue = Arc::new(TaskQueue {
            ticket: AtomicU64::new(0),
            done: AtomicU32::new(0),
            started: AtomicU32::new(0),
            parked: (0..n_workers).map(|_| AtomicBool::new(false)).collect(),
            stop: AtomicBool::new(false),
        });
        // The team exists before its workers, so that dropping it stops the started ones if one
        // cannot start.
        let mut team =
            Self { work, queue, workers: Vec::new(), backoff: Mutex::new(Backoff::new()) };
        for worker in 0..n_workers {
            let (work, queue) = (Arc::clone(&team.work), Arc::clone(&team.queue));
            let handle = thread::Builder::new()
                .name(format!("infer-{}", worker + 1))
                .spawn(move || queue.serve(&*work, worker))?;
            team.workers.push(handle);
        }
        // A starting thread allocates memory; waiting for all of them ensures that none does so
        // later.
        while (team.queue.started.load(Ordering::Acquire) as usize) < n_workers {
            thread::yield_now();
        }
        Ok(team)
    }

    /// The work of the team.
    #[must_use]
    pub fn work(&self) -> &W {
        &self.work
    }

    /// Processes all `n_chunks` (at most [`MOST_CHUNKS`]) of the current task, and returns when
    /// they are finished.
    pub fn run(&self, n_chunks: usize) {
        assert!(n_chunks <= MOST_CHUNKS, "a task of {n_chunks} chunks");
        let alone = || (0..n_chunks).for_each(|chunk| self.work.chunk(0, chunk));
        // Before the clock is read, which WebAssembly lacks.
        if n_chunks <= 1 || self.workers.is_empty() {
            return alone();
        }
        let start = Instant::now();
        let mut backoff = self.backoff.lock().unwrap_or_else(PoisonError::into_inner);
        if backoff.is_on(start) {
            return alone();
        }
        let queue = &*self.queue;
        queue.announce(n_chunks);
        let wanted = self.workers.iter().zip(&queue.parked).take(n_chunks - 1);
        for (worker, parked) in wanted {
            if parked.swap(false, Ordering::SeqCst) {
                worker.thread().unpark();
            }
        }
        let mut n_own = 0;
        while let Some(chunk) = queue.claim() {
            queue.perform(&*self.work, 0, chunk);
            n_own += 1;
        }
        let done = Instant::now();
        queue.wait_until_done(n_chunks);
        let end = Instant::now();
        let usual = (done - start) / n_own.max(1) * LONG_WAIT_CHUNKS + LONG_WAIT;
        backoff.note(end - done > usual, end);
    }
}

impl<W: Work> Drop for Team<W> {
    fn drop(&mut self) {
        self.queue.stop.store(true, Ordering::SeqCst);
        self.workers.iter().for_each(|worker| worker.thread().unpark());
        for worker in self.workers.drain(..) {
            // The panic of a worker has been printed already.
            let _ = worker.join();
        }
    }
}

impl TaskQueue {
    /// Starts the next task. All chunks of the previous one must be finished.
    fn announce(&self, n_chunks: usize) {
        let number = (self.ticket.load(Ordering::Relaxed) >> 32).wrapping_add(1);
        self.done.store(0, Ordering::Relaxed);
        // SeqCst pairs with `serve`, which sets `parked` and then checks the ticket again.
        self.ticket.store(number << 32 | (n_chunks as u64) << 16, Ordering::SeqCst);
    }

    /// Claims a chunk of the current task, if any is left.
    fn claim(&self) -> Option<usize> {
        let claim = self.ticket.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |ticket| {
            let (n_chunks, next) = (ticket >> 16 & 0xffff, ticket & 0xffff);
            (next < n_chunks).then_some(ticket + 1)
        });
        claim.ok().map(|ticket| (ticket & 0xffff) as usize)
    }

    fn wait_until_done(&self, n_chunks: usize) {
        let mut spins = 0u32;
        while self.done.load(Ordering::Acquire) < n_chunks as u32 {
            spins += 1;
            // The thread that holds the chunk may be waiting for this core.
            if spins > 1000 { thread::yield_now() } else { std::hint::spin_loop() }
        }
    }

    /// The loop of a worker.
    fn serve(&self, work: &impl Work, worker: usize) {
        self.started.fetch_add(1, Ordering::Release);
        loop {
            while let Some(chunk) = self.claim_soon() {
                self.perform(work, worker + 1, chunk);
            }
            if self.stop.load(Ordering::SeqCst) {
                return;
            }
            self.parked[worker].store(true, Ordering::SeqCst);
            if !self.has_work() && !self.stop.load(Ordering::SeqCst) {
                thread::park();
            }
            self.parked[worker].store(false, Ordering::SeqCst);
        }
    }

    /// Processes a chunk and counts it as finished, even if it panics: the caller must not wait
    /// forever, and will find the lock that the panic poisoned.
    fn perform(&self, work: &impl Work, thread: usize, chunk: usize) {
        struct Count<'a>(&'a AtomicU32);
        impl Drop for Count<'_> {
            fn drop(&mut self) {
                self.0.fetch_add(1, Ordering::Release);
            }
        }
        let _count = Count(&self.done);
        work.chunk(thread, chunk);
    }

    /// Spins for at most [`SPIN`] to claim a chunk.
    fn claim_soon(&self) -> Option<usize> {
        let mut idle_since = None;
        loop {
            if let Some(chunk) = self.claim() {
                return Some(chunk);
            }
            let idle_since = idle_since.get_or_insert_with(Instant::now);
            if idle_since.elapsed() > SPIN || self.stop.load(Ordering::Relaxed) {
                return None;
            }
            std::hint::spin_loop();
        }
    }

    fn has_work(&self) -> bool {
        let ticket = self.ticket.load(Ordering::SeqCst);
        (ticket & 0xffff) < (ticket >> 16 & 0xffff)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Tally {
        counts: Vec<AtomicU32>,
    }

    impl Work for Tally {
        fn chunk(&self, _: usize, chunk: usize) {
            self.counts[chunk].fetch_add(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn every_chunk_of_every_task_is_done_once() {
        for n_threads in 1..=4 {
            let counts = (0..100).map(|_| AtomicU32::new(0)).collect();
            let team = Team::new(Tally { counts }, n_threads).unwrap();
            for task in 0..3000 {
                team.run(task % 101);
                // Now and then let the workers fall asleep.
                if task % 1000 == 999 {
                    thread::sleep(10 * SPIN);
                }
            }
            for (chunk, count) in team.work().counts.iter().enumerate() {
                let tasks = (0..3000).filter(|task| task % 101 > chunk).count();
                assert_eq!(count.load(Ordering::Relaxed), tasks as u32, "{n_threads} {chunk}");
            }
        }
    }

    /// Delays the worker in its first chunk, as another process would.
    struct HeldUp {
        began: AtomicBool,
        by_workers: AtomicU32,
    }

    impl Work for HeldUp {
        fn chunk(&self, thread: usize, _: usize) {
            if thread > 0 {
                self.by_workers.fetch_add(1, Ordering::SeqCst);
                if !self.began.swap(true, Ordering::SeqCst) {
                    thread::sleep(Duration::from_millis(50));
                }
            }
            while !self.began.load(Ordering::SeqCst) {
                thread::yield_now();
            }
        }
    }

    #[test]
    fn after_a_worker_was_held_up_the_caller_works_alone_for_a_while() {
        let work = HeldUp { began: AtomicBool::new(false), by_workers: AtomicU32::new(0) };
        let team = Team::new(work, 2).unwrap();
        team.run(2);
        let before = team.work().by_workers.load(Ordering::SeqCst);
        // This takes much less time than the shortest backoff, unless this thread is delayed
        // itself.
        let start = Instant::now();
        team.run(1000);
        let after = team.work().by_workers.load(Ordering::SeqCst);
        assert!(before == after || start.elapsed() > Backoff::SHORTEST, "{before} {after}");
    }

    #[test]
    fn pauses_lengthen_while_waits_are_long_and_shorten_once_they_are_not() {
        let (mut backoff, now) = (Backoff::new(), Instant::now());
        assert!(!backoff.is_on(now));
        backoff.note(true, now);
        assert!(backoff.is_on(now) && !backoff.is_on(now + Backoff::SHORTEST));
        (0..20).for_each(|_| backoff.note(true, now));
        assert_eq!(backoff.length, Backoff::LONGEST);
        (0..20 * Backoff::GOOD_TASKS).for_each(|_| backoff.note(false, now));
        assert_eq!(backoff.length, Backoff::SHORTEST);
    }
}
