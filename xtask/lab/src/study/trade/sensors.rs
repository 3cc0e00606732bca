//! The VLP-32C, and the sensors and settings compared with it.

use crate::study::datasets::as_even_grid;
use sim_gpu::effects::{
    Detection, Effects, Footprint, Noise, NoiseModel, Quantum, ReturnMode, Weather,
};
use sim_gpu::internals::sensor::{DetectionLimit, Layout, SensorProfile};
use std::num::NonZeroU32;

#[derive(Clone)]
pub struct Scanning {
    /// The parameter that differs from the reference.
    pub parameter: &'static str,
    /// The sensor's name, and how it differs from its profile.
    pub name: String,
    pub sensor: SensorProfile,
    /// To the object's centre.
    pub distance_m: f64,
    pub noise_m: f64,
    /// 0: ranges are not rounded.
    pub range_quantum_m: f64,
    /// Further effects of the sensor and the air.
    pub further: Effects,
}

const DISTANCE_M: f64 = 3.0;
const NOISE_M: f64 = 0.01;

impl Scanning {
    /// The real beam table at 600 rpm, as gen-dataset's rotating set has it.
    pub fn reference() -> Self {
        let sensor = vlp32c();
        Self {
            parameter: "reference",
            name: sensor.name.clone(),
            sensor,
            distance_m: DISTANCE_M,
            noise_m: NOISE_M,
            range_quantum_m: 0.0,
            further: Effects::default(),
        }
    }

    /// The reference without any effect: the truth to compare with.
    pub fn clean(distance_m: f64) -> Self {
        Self { distance_m, noise_m: 0.0, ..Self::reference() }
    }

    /// Noise, rounding and all else, where they are asked for.
    pub fn effects(&self) -> Effects {
        let noise = Noise { mean_m: 0.0, sigma_m: self.noise_m, model: NoiseModel::Range };
        Effects {
            noise: (self.noise_m > 0.0).then_some(noise),
            quantum: (self.range_quantum_m > 0.0)
                .then_some(Quantum { step_m: Some(self.range_quantum_m) }),
            ..self.further.clone()
        }
    }

    pub fn beams(&self) -> usize {
        match &self.sensor.layout {
            Layout::Rotating(rotating) => rotating.beam.len(),
            Layout::Uniform(uniform) => uniform.elevation_steps as usize,
            Layout::Grid(camera) => camera.height as usize,
            Layout::Risley(rosette) => rosette.line.len(),
            Layout::Table(table) => usize::from(table.lines),
        }
    }

    /// The angle from one firing to the next; `None` for cameras and rosettes.
    pub fn azimuth_step_deg(&self) -> Option<f64> {
        let step_deg = match &self.sensor.layout {
            Layout::Rotating(rotating) => 360.0 * rotating.sequence_us * 1e-6 / rotating.period_s(),
            Layout::Uniform(uniform) => {
                let span_deg = uniform.azimuth_to_deg - uniform.azimuth_from_deg;
                span_deg / f64::from(uniform.azimuth_steps.max(2) - 1)
            }
            Layout::Grid(_) | Layout::Risley(_) | Layout::Table(_) => return None,
        };
        Some(step_deg * f64::from(self.sensor.decimation.get()))
    }

    fn varying(self, parameter: &'static str) -> Self {
        Self { parameter, ..self }
    }

    /// Each `keep_each`-th beam by elevation, from below.
    fn with_beams(mut self, keep_each: usize) -> Self {
        if let Layout::Rotating(rotating) = &mut self.sensor.layout {
            let mut by_elevation: Vec<usize> = (0..rotating.beam.len()).collect();
            let elevation = |&i: &usize| rotating.beam[i].elevation_deg;
            by_elevation.sort_by(|a, b| elevation(a).total_cmp(&elevation(b)));
            let kept: Vec<usize> = by_elevation.into_iter().step_by(keep_each).collect();
            let mut place = 0..;
            rotating.beam.retain(|_| place.next().is_some_and(|i: usize| kept.contains(&i)));
        }
        let name = format!("{}, {} beams", self.name, self.beams());
        Self { name, ..self }
    }

    /// One firing each 0.1° times `k`: 300 rpm, of which each `k`-th is kept.
    fn with_azimuth(self, k: u32) -> Self {
        let mut sensor = self.sensor;
        if let Layout::Rotating(rotating) = &mut sensor.layout {
            rotating.rpm = 300.0;
        }
        let sensor = sensor.decimated(NonZeroU32::new(k).unwrap_or(NonZeroU32::MIN));
        Self { sensor, ..self }
    }
}

/// Each parameter changed alone, the others as in the reference.
pub fn one_at_a_time() -> Vec<Scanning> {
    let reference = Scanning::reference;
    let mut all = vec![reference()];
    all.extend([2, 4].map(|keep_each| reference().with_beams(keep_each).varying("beams")));
    // As many rays as the VLP-32C has, on an even grid of the same field of view.
    let grid = as_even_grid(vlp32c()).expect("invariant: the VLP-32C has a table of beams");
    let name = "even grid of 32 rows".to_owned();
    all.push(Scanning { name, sensor: grid, ..reference().varying("beam table") });
    for name in ["blainder-ultrapuck", "os1-128", "vls128", "xt32", "avia"] {
        let sensor = SensorProfile::builtin(name).expect("invariant: it is built in");
        let name = name.to_owned();
        all.push(Scanning { name, sensor, ..reference().varying("beam table") });
    }
    all.extend(effects());
    all.extend([1, 4, 8].map(|k| reference().with_azimuth(k).varying("azimuth step")));
    all.extend([0.004, 0.02].map(|range_quantum_m| Scanning {
        range_quantum_m,
        ..reference().varying("range quantum")
    }));
    all.extend(
        [0.0, 0.005, 0.02, 0.05, 0.1]
            .map(|noise_m| Scanning { noise_m, ..reference().varying("noise") }),
    );
    all.extend(
        [2.0, 5.0, 10.0, 20.0, 50.0]
            .map(|distance_m| Scanning { distance_m, ..reference().varying("distance") }),
    );
    all
}

fn effects() -> Vec<Scanning> {
    let none = Effects::default;
    let weather = |weather| Effects { weather: Some(Box::new(weather)), ..none() };
    let wide = |samples| Footprint { samples, divergence_deg: None, separation_m: None };
    // A limit near the object: white surfaces 3 m away are lost where they turn away by 89.4
    // degrees, and those that face the sensor are off by 7 mm.
    let limit = DetectionLimit { reflectivity: 0.1, range_m: 9.0 };
    let near_limit =
        Detection { limit: Some(limit), threshold_to_noise: Some(5.0), range_sigma_m: Some(0.06) };
    let all = [
        ("detection limit", Effects { detection: Some(near_limit), ..none() }),
        ("7 rays a beam", Effects { footprint: Some(wide(7)), ..none() }),
        ("19 rays a beam", Effects { footprint: Some(wide(19)), ..none() }),
        (
            "last return, 7 rays a beam",
            Effects { footprint: Some(wide(7)), returns: Some(ReturnMode::Last), ..none() },
        ),
        ("rain 25 mm/h", weather(Weather { rain_mm_h: Some(25.0), ..Weather::default() })),
        ("snow 2 mm/h", weather(Weather { snow_mm_h: Some(2.0), ..Weather::default() })),
        ("fog 50 m", weather(Weather { fog_visibility_m: Some(50.0), ..Weather::default() })),
    ];
    let setting = |(name, further): (&str, Effects)| {
        let reference = Scanning::reference().varying("effect");
        // As in gen-dataset, whose clouds are of single objects.
        let further = Effects {
            weather: further.weather.map(|w| Box::new(Weather { empty_beams: Some(false), ..*w })),
            ..further
        };
        Scanning { name: format!("{}, {name}", reference.name), further, ..reference }
    };
    all.into_iter().map(setting).collect()
}

/// Fewer beams and fewer azimuth steps in all combinations, near and far: what
/// loses nothing at 3 m may lose everything at 20 m.
pub fn combinations() -> Vec<Scanning> {
    let mut all = Vec::new();
    for distance_m in [3.0, 5.0, 10.0, 20.0] {
        let whole = Scanning { distance_m, ..Scanning::reference() }.varying("combination");
        let [half, quarter] = [2, 4].map(|keep_each| whole.clone().with_beams(keep_each));
        for beams in [whole, half, quarter] {
            all.extend([2, 4, 8].map(|k| beams.clone().with_azimuth(k)));
        }
    }
    all
}

fn vlp32c() -> SensorProfile {
    SensorProfile::builtin("vlp32c").expect("invariant: this profile is built in")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn azimuth_steps_are_those_of_the_sensor() {
        // SIMULATORS' table: 0.09953° at 300 rpm, 0.19907° at 600.
        let step_deg = |scanning: &Scanning| scanning.azimuth_step_deg().unwrap();
        assert!((step_deg(&Scanning::reference()) - 0.19907).abs() < 1e-5);
        let fine = Scanning::reference().with_azimuth(1);
        assert!((step_deg(&fine) - 0.09953).abs() < 1e-5);
        let coarse = Scanning::reference().with_azimuth(8);
        // The last sequence of a revolution may be cut short.
        let rays = |scanning: &Scanning| scanning.sensor.pattern().len();
        assert!((8 * rays(&coarse)).abs_diff(rays(&fine)) <= 8 * 32);
    }
}
