//! rten, with its weights packed beforehand.

use crate::turns::Run;
use anyhow::Result;
use rten::{ModelOptions, RunOptions, ThreadPool};
use rten_tensor::prelude::*;
use rten_tensor::{NdTensor, NdTensorView};
use std::path::Path;
use std::sync::Arc;

/// Of the crate.
pub const VERSION: &str = "0.27.0";

/// See [`crate::turns::Ready`].
pub fn ready(file: &Path, x: &[f32], threads: usize) -> Result<Run> {
    let model = ModelOptions::with_all_ops().prepack_weights(true).load_file(file)?;
    let (input, output) = (model.node_id("x")?, model.node_id("logp")?);
    let pool = Arc::new(ThreadPool::with_num_threads(threads));
    let x = NdTensor::from_data([1, 3, x.len() / 3], x.to_vec());
    Ok(Box::new(move || {
        let options = RunOptions::default().with_thread_pool(Some(Arc::clone(&pool)));
        let inputs = vec![(input, x.view().into())];
        let [logp] = model.run_n(inputs, [output], Some(options))?;
        let logp: NdTensor<f32, 2> = logp.try_into()?;
        Ok(logp.to_vec())
    }))
}
