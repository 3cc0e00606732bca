use crate::arrays::points;
use crate::error::{raised, warn};
use formats::plausible::{Unlike, judge_object};
use infer_cpu::Options;
use infer_cpu::sampler::SamplerSpec;
use numpy::{IntoPyArray, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// A network, and how it computes: on the caller's thread.
#[pyclass(module = "edgepuck._edgepuck", frozen)]
pub struct Classifier {
    classifier: Mutex<infer_cpu::Classifier>,
    /// Whether it learnt whole objects.
    is_of_wholes: bool,
}

#[pymethods]
impl Classifier {
    /// A bundled model by its name, or one in a file.
    #[new]
    fn new(
        py: Python<'_>,
        model: &str,
        precision: &str,
        sampler: Option<&str>,
        n_points: Option<usize>,
    ) -> PyResult<Self> {
        let mut options =
            Options { precision: precision.parse().map_err(raised)?, ..Options::default() };
        if let Some(kind) = sampler {
            let kind = kind.parse().map_err(raised)?;
            options.sampler = Some(SamplerSpec { kind, ..SamplerSpec::default() });
        }
        if let Some(points) = n_points {
            options.sampler.get_or_insert_default().points = points;
        }
        let loaded = py.detach(|| infer_cpu::Classifier::load(Path::new(model), &options));
        let is_of_wholes = model == "edge-64";
        Ok(Self { classifier: Mutex::new(loaded.map_err(raised)?), is_of_wholes })
    }

    /// The classes' names, in the order of the logits.
    #[getter]
    fn classes(&self) -> Vec<String> {
        self.lock().classes().iter().map(|class| class.to_string()).collect()
    }

    /// Classify a cloud, `[n, 3]`, of one side if it `is_scan`, that stands on ground of this height,
    /// if it is known.
    fn classify<'py>(
        &self,
        py: Python<'py>,
        cloud: PyReadonlyArray2<'py, f32>,
        ground_z: Option<f32>,
        is_scan: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let cloud = points(&cloud)?;
        let wide: Vec<_> = cloud.iter().map(|point| point.map(f64::from)).collect();
        let found = judge_object(&wide, [0.0; 3]).map_err(raised)?;
        let unlike = found.or(is_scan.then_some(Unlike::OneSide));
        let unlike = unlike.filter(|of| self.is_of_wholes || *of == Unlike::Sweep);
        warn(py, unlike.map(|of| format!("the cloud {of}")).as_slice())?;
        let found = py.detach(|| {
            let mut classifier = self.lock();
            classifier.classify_on_ground(&cloud, ground_z).cloned()
        });
        let found = found.map_err(raised)?;
        let dropped = (found.n_dropped > 0).then(|| {
            format!(
                "dropped {} at 0, 0, 0 or not finite: lost returns",
                formats::counted(found.n_dropped, "point")
            )
        });
        warn(py, dropped.as_slice())?;
        let answer = PyDict::new(py);
        answer.set_item("label", found.answer())?;
        answer.set_item("index", found.class)?;
        answer.set_item("is_unknown", found.is_unknown)?;
        answer.set_item("confidence", found.confidence())?;
        answer.set_item("logits", found.logits.clone().into_pyarray(py))?;
        Ok(answer)
    }
}

impl Classifier {
    /// The network, which one thread at a time uses. A fork finds it locked only while another
    /// thread of the parent classifies.
    fn lock(&self) -> std::sync::MutexGuard<'_, infer_cpu::Classifier> {
        self.classifier.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
