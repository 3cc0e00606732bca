//! Edgepuck in a page of a browser: what `page/worker.js` calls.
//!
//! A [`Simulator`] has a subject (a mesh, or a street), a network, and what casts: WebGPU or the CPU. It
//! runs natively too, with which tests compare the browser.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod settings;
mod subject;

use infer_cpu::{Classifier, Options};
use settings::Settings;
use sim_gpu::columns::Attribute;
use sim_gpu::internals::resolve::resolve;
use sim_gpu::internals::scan::{ScanRequest, aim_all};
use sim_gpu::{Caster, Effects, Mesh, Sensor};
use subject::Subject;
use wasm_bindgen::prelude::wasm_bindgen;

/// What an error says to the user.
type Words = String;

/// A subject, a network, and what casts.
#[wasm_bindgen]
pub struct Simulator {
    caster: Caster,
    subject: Subject,
    sensor: Sensor,
    classifier: Option<Classifier>,
}

/// A scan and its class.
#[wasm_bindgen(getter_with_clone)]
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Scanned {
    /// Metres in the world, x, y and z of one point after another.
    pub positions: Vec<f32>,
    /// Metres from the sensor, by point.
    pub range: Vec<f32>,
    /// The ring of each point, from below.
    pub ring: Vec<u16>,
    /// The number of the instance, by point.
    pub object: Vec<u32>,
    /// 0 to 1, by point.
    pub intensity: Vec<f32>,
    /// From the sensor's frame to the world's: a matrix of 4 by 4, row by row.
    pub pose: Vec<f64>,
    /// The labels of the instances, separated by commas.
    pub labels: String,
}

/// What a caster finds, without effects.
#[wasm_bindgen(getter_with_clone)]
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Traced {
    /// The caster's answer for each ray: a triangle, or none, and whether f64 decides.
    pub codes: Vec<u32>,
    /// The triangles of the rays that hit, in the order of jobs and beams.
    pub triangles: Vec<u32>,
    /// Their ranges, metres.
    pub ranges: Vec<f64>,
}

/// What the network calls a scan.
#[wasm_bindgen(getter_with_clone)]
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Answer {
    /// The class, or `unknown`.
    pub class: String,
    /// Its probability, 0 to 1.
    pub probability: f64,
}

#[wasm_bindgen]
impl Simulator {
    /// Casts by the best GPU for `auto`, or by the CPU if none opens; by the CPU for `cpu`; else by the first
    /// adapter whose name contains `adapter`.
    ///
    /// # Errors
    /// No adapter has such a name, or it does not open.
    pub async fn open(adapter: &str) -> Result<Self, Words> {
        let caster = Caster::named_async(adapter).await.map_err(words)?;
        let sensor = Sensor::named("vlp32c").map_err(words)?;
        let subject = Subject::built_in("chair")?;
        Ok(Self { caster, subject, sensor, classifier: None })
    }

    /// The names of the sensors.
    #[must_use]
    pub fn sensors() -> Vec<String> {
        Sensor::names().map(str::to_owned).collect()
    }

    /// The names that [`Simulator::take_built_in`] takes.
    #[must_use]
    pub fn built_ins() -> Vec<String> {
        subject::names().map(str::to_owned).collect()
    }

    /// Makes a built-in object or street the subject.
    ///
    /// # Errors
    /// There is none of this name.
    pub fn take_built_in(&mut self, name: &str) -> Result<(), Words> {
        self.subject = Subject::built_in(name)?;
        Ok(())
    }

    /// Makes the mesh in a file of this name and content the subject, and returns what is
    /// probably wrong with it.
    ///
    /// # Errors
    /// The file is no mesh: with the line and the cause.
    pub fn take_file(&mut self, name: &str, bytes: &[u8]) -> Result<Vec<String>, Words> {
        let (subject, warnings) = Subject::of_file(name, bytes)?;
        self.subject = subject;
        Ok(warnings)
    }

    /// The corners of the subject's mesh, metres, x, y and z of one after another; none of a street.
    #[must_use]
    pub fn mesh_positions(&self) -> Vec<f32> {
        let corners = self.subject.mesh().into_iter().flat_map(Mesh::vertices);
        corners.flat_map(|corner| corner.as_vec3().to_array()).collect()
    }

    /// The triangles of the subject's mesh: three numbers of corners for each.
    #[must_use]
    pub fn mesh_indices(&self) -> Vec<u32> {
        self.subject.mesh().into_iter().flat_map(Mesh::triangles).flatten().copied().collect()
    }

    /// Classifies by this model file from now on.
    ///
    /// # Errors
    /// The bytes are no model.
    pub fn take_model(&mut self, bytes: &[u8]) -> Result<(), Words> {
        let classifier = Classifier::from_bytes(bytes, &Options::default());
        self.classifier = Some(classifier.map_err(words)?);
        Ok(())
    }

    /// Scans the subject; `settings` are as JSON, with the names and units of `settings.rs`.
    ///
    /// # Errors
    /// A setting is out of its bounds; the sensor lacks what an effect needs; the adapter failed.
    pub async fn scan(&mut self, settings: &str) -> Result<Scanned, Words> {
        let settings = self.set(settings)?;
        let (scene, pose) = self.subject.scene(&settings);
        let attributes = [Attribute::Range, Attribute::Ring, Attribute::Object];
        let scan = scene.scan(&self.sensor, pose).with(&self.caster);
        let scan = scan.effects(settings.effects()).attributes(attributes);
        let points = scan.run_async().await.map_err(words)?.points;
        let label = |instance: &sim_gpu::Instance| instance.label.clone().unwrap_or_default();
        let labels: Vec<String> = scene.instances().iter().map(label).collect();
        Ok(Scanned {
            positions: points.positions.into_flattened(),
            range: points.range_m.unwrap_or_default(),
            ring: points.ring.unwrap_or_default(),
            object: points.object.unwrap_or_default(),
            intensity: points.intensity.unwrap_or_default(),
            pose: pose.matrix().to_vec(),
            labels: labels.join(","),
        })
    }

    /// What the caster finds by the sensor, the distance and the angles of `settings`: what tests compare
    /// bit by bit.
    ///
    /// # Errors
    /// As [`Simulator::scan`].
    pub async fn trace(&mut self, settings: &str) -> Result<Traced, Words> {
        let settings = self.set(settings)?;
        let (scene, pose) = self.subject.scene(&settings);
        let (plain, pattern) = (Effects::default(), self.sensor.pattern());
        let placed = scene.placed(|_, _| None);
        let jobs =
            aim_all(&placed, &ScanRequest::new(self.sensor.profile(), pattern, pose), &plain);
        let caster = self.caster.for_effects_async(&plain).await.map_err(words)?;
        let casts = caster.cast_async(&jobs).await.map_err(words)?;
        let solved = jobs.iter().zip(&casts).map(|(job, cast)| resolve(job, cast, pattern, &plain));
        let hits = solved.flat_map(|found| found.hits).map(|hit| (hit.triangle, hit.range_m));
        let (triangles, ranges) = hits.unzip();
        let codes = casts.into_iter().flat_map(|cast| cast.codes).collect();
        Ok(Traced { codes, triangles, ranges })
    }

    /// What the network calls the points of `scanned`; nothing without a network, without points, and
    /// for a street.
    ///
    /// # Errors
    /// The network overflows.
    pub fn classify(&mut self, scanned: &Scanned) -> Result<Option<Answer>, Words> {
        let (points, _) = scanned.positions.as_chunks::<3>();
        let (Some(classifier), Subject::Object(_), false) =
            (&mut self.classifier, &self.subject, points.is_empty())
        else {
            return Ok(None);
        };
        let found = classifier.classify(points).map_err(words)?;
        let probability = found.confidence();
        Ok(Some(Answer { class: found.answer().to_owned(), probability }))
    }
}

impl Simulator {
    /// The settings in this JSON, whose sensor is taken from now on.
    fn set(&mut self, settings: &str) -> Result<Settings, Words> {
        let settings: Settings = serde_json::from_str(settings).map_err(words)?;
        if self.sensor.name() != settings.sensor {
            self.sensor = Sensor::named(&settings.sensor).map_err(words)?;
        }
        Ok(settings)
    }
}

fn words(error: impl std::fmt::Display) -> Words {
    error.to_string()
}
