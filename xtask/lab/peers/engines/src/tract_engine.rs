//! tract: the model optimised for one size of cloud.

use crate::turns::Run;
use anyhow::Result;
use std::path::Path;
use tract_linalg::multithread::{Executor, set_default_executor};
use tract_onnx::prelude::*;

/// Of the crate.
pub const VERSION: &str = "0.23.9";

/// See [`crate::turns::Ready`].
pub fn ready(file: &Path, x: &[f32], threads: usize) -> Result<Run> {
    set_default_executor(match threads {
        1 => Executor::SingleThread,
        _ => Executor::multithread(threads),
    });
    let shape = [1, 3, x.len() / 3];
    let model = tract_onnx::onnx()
        .model_for_path(file)?
        .with_input_fact(0, f32::fact(shape).into())?
        .into_optimized()?
        .into_runnable()?;
    let x: TValue = Tensor::from_shape(&shape, x)?.into();
    Ok(Box::new(move || {
        let outputs = model.run(tvec!(x.clone()))?;
        Ok(outputs[0].to_plain_array_view::<f32>()?.iter().copied().collect())
    }))
}
