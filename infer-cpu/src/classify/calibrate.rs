//! Calibration for int8: the largest activation of each layer.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use edgepuck_kernels::F32;
#[cfg(feature = "npz")]
use formats::labelled::LabelledSet;
use formats::streams::Stream;

use crate::classify::normalize::{normalize, to_unit_sphere};
use crate::engine::team::Team;
use crate::engine::{Engine, Forward, Input};
use crate::error::Error;
use crate::kernel;
use crate::model::layers;
use crate::model::source::ModelSource;

const SHAPE_POINTS: usize = 512;
/// Shapes of each kind.
const SHAPES: u32 = 12;

/// The most clouds of a set that are used: more hardly change the largest activations.
#[cfg(feature = "npz")]
const CLOUDS_OF_SET: usize = 512;

/// [`on_clouds`] for clouds at even steps through `set`.
///
/// # Errors
/// A file that is not a model.
#[cfg(feature = "npz")]
pub fn on_set(path: &Path, set: &LabelledSet) -> Result<BTreeMap<String, f32>, Error> {
    let step = set.len().div_ceil(CLOUDS_OF_SET).max(1);
    on_clouds(path, (0..set.len()).step_by(step).map(|i| set.cloud(i)))
}

/// The largest activation of each layer of the model at `path` on `clouds`, which are normalised as
/// the network expects, or in metres if it expects metres.
///
/// # Errors
/// A file that is not a model.
pub fn on_clouds<'a>(
    path: &Path,
    clouds: impl IntoIterator<Item = &'a [[f32; 3]]>,
) -> Result<BTreeMap<String, f32>, Error> {
    on_clouds_of(&ModelSource::of(path)?, clouds)
}

fn on_clouds_of<'a>(
    model: &ModelSource,
    clouds: impl IntoIterator<Item = &'a [[f32; 3]]>,
) -> Result<BTreeMap<String, f32>, Error> {
    let (mut file, card) = model.open()?;
    let kernels = kernel::fastest();
    let layers = layers::pack::<F32>(&mut file, &card, kernels)?;
    let team = Team::new(Engine::new(Arc::new(layers), kernels, 1, true), 1)
        .map_err(|source| Error::Threads { threads: 1, source })?;
    let mut scratch = team.scratch();
    let (mut wide, mut metric) = (Vec::new(), Vec::new());
    for cloud in clouds {
        let cloud = if card.normalization.is_metric() {
            wide.clear();
            wide.extend(cloud.iter().map(|point| point.map(f64::from)));
            normalize(card.normalization, &wide, None, &mut metric);
            &metric
        } else {
            cloud
        };
        let input = Input { points: cloud, cloud, pooled_stn: false };
        Engine::observe(&team, &input, &mut scratch);
    }
    let observed = team.work().observed().into_iter();
    Ok(observed.filter(|(_, largest)| largest.is_normal()).collect())
}

/// [`on_clouds`] for generated spheres, boxes, rods and plates: for a model without calibration,
/// where there is no data.
///
/// # Errors
/// A file that is not a model.
pub fn on_shapes(path: &Path) -> Result<BTreeMap<String, f32>, Error> {
    on_shapes_of(&ModelSource::of(path)?)
}

pub fn on_shapes_of(model: &ModelSource) -> Result<BTreeMap<String, f32>, Error> {
    let clouds: Vec<_> = (0..4 * SHAPES).map(shape).collect();
    on_clouds_of(model, clouds.iter().map(Vec::as_slice))
}

/// A randomly stretched shape: a solid box, the surface of a box, the surface of an ellipsoid, or
/// two separate boxes.
fn shape(number: u32) -> Vec<[f32; 3]> {
    let key = Stream::Calibration { shape: number }.key(0);
    let unit = |n: usize| 2.0 * key.unit(n as u64) - 1.0;
    // From rods and plates to cubes.
    let size = [0, 1, 2].map(|axis| libm::exp(-3.0 * key.unit(axis)));
    let points: Vec<[f64; 3]> = (0..SHAPE_POINTS)
        .map(|i| {
            let mut p = [0, 1, 2].map(|axis| unit(16 + 4 * i + axis));
            let face = i % 3;
            match number % 4 {
                1 => p[face] = p[face].signum(),
                2 => {
                    let radius = p.iter().map(|x| x * x).sum::<f64>().sqrt();
                    p = p.map(|x| x / radius.max(1e-9));
                }
                3 => p[2] = p[2].signum() + 0.2 * p[2],
                _ => {}
            }
            [0, 1, 2].map(|axis| p[axis] * size[axis])
        })
        .collect();
    let mut cloud = Vec::new();
    to_unit_sphere(&points, &mut cloud);
    cloud
}
