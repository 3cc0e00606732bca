//! Many clouds at a time, one thread for each.

use std::sync::{Mutex, MutexGuard, PoisonError, RwLock};

use crate::classify::classifier::Classifier;
use crate::classify::prediction::Prediction;
use crate::engine::team::{Team, Work};
use crate::error::Error;

/// Clouds per thread in a batch: large and small ones even out.
const CLOUDS_PER_THREAD: usize = 8;

/// Classifiers that share the weights of one model and run in parallel, each in a thread of its
/// own.
///
/// A [`Classifier`] with several threads divides one cloud among them, which is faster for a single
/// cloud. For many clouds, one thread per cloud is faster. The predictions are the same. Clouds
/// within [`Options::capacity`](crate::Options::capacity) cause no allocation.
pub struct ClassifierTeam {
    team: Team<Clouds>,
}

struct Clouds {
    clouds: Vec<RwLock<Cloud>>,
    /// One for each thread.
    classifiers: Vec<Mutex<Classifier>>,
    answers: Vec<Mutex<Answer>>,
}

#[derive(Default)]
struct Cloud {
    points: Vec<[f32; 3]>,
    ground_z: Option<f32>,
}

struct Answer {
    prediction: Prediction,
    error: Option<Error>,
}

impl Work for Clouds {
    fn chunk(&self, thread: usize, chunk: usize) {
        let cloud = self.clouds[chunk].read().unwrap_or_else(PoisonError::into_inner);
        let mut classifier = lock(&self.classifiers[thread]);
        let mut answer = lock(&self.answers[chunk]);
        match classifier.classify_on_ground(&cloud.points, cloud.ground_z) {
            Ok(prediction) => {
                answer.prediction.clone_from(prediction);
                answer.error = None;
            }
            Err(error) => answer.error = Some(error),
        }
    }
}

impl ClassifierTeam {
    /// As many classifiers as `classifier` has threads, with the same options.
    ///
    /// # Errors
    /// Threads that cannot be started.
    pub fn new(classifier: Classifier) -> Result<Self, Error> {
        let n_threads = classifier.options().threads.max(1);
        let capacity = classifier.options().capacity;
        let n_clouds = n_threads * CLOUDS_PER_THREAD;
        let answer = || Mutex::new(Answer { prediction: classifier.no_prediction(), error: None });
        let cloud = || RwLock::new(Cloud { points: Vec::with_capacity(capacity), ground_z: None });
        let twins = (0..n_threads).map(|_| Ok(Mutex::new(classifier.twin()?)));
        let work = Clouds {
            clouds: (0..n_clouds).map(|_| cloud()).collect(),
            classifiers: twins.collect::<Result<_, Error>>()?,
            answers: (0..n_clouds).map(|_| answer()).collect(),
        };
        let threads = |source| Error::Threads { threads: n_threads, source };
        Ok(Self { team: Team::new(work, n_threads).map_err(threads)? })
    }

    /// Classifies clouds as [`Classifier::classify_on_ground`] does, given the points of each and
    /// the height of the ground under it, and passes the predictions to `each` in order.
    pub fn classify_many<'a>(
        &mut self,
        clouds: impl IntoIterator<Item = (&'a [[f32; 3]], Option<f32>)>,
        mut each: impl FnMut(Result<&Prediction, &Error>),
    ) {
        let mut clouds = clouds.into_iter();
        let work = self.team.work();
        loop {
            let mut n = 0;
            for (waiting, (points, ground_z)) in work.clouds.iter().zip(&mut clouds) {
                let mut waiting = waiting.write().unwrap_or_else(PoisonError::into_inner);
                waiting.points.clear();
                waiting.points.extend_from_slice(points);
                waiting.ground_z = ground_z;
                n += 1;
            }
            if n == 0 {
                return;
            }
            self.team.run(n);
            for answer in &work.answers[..n] {
                let answer = lock(answer);
                each(answer.error.as_ref().map_or(Ok(&answer.prediction), Err));
            }
        }
    }
}

/// Ignores poison: a panic in a worker has been reported, and the next cloud overwrites what it
/// left.
fn lock<V>(lock: &Mutex<V>) -> MutexGuard<'_, V> {
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}
