//! What a user of the page sets.

use serde::Deserialize;
use sim_gpu::Effects;
use sim_gpu::effects::{Footprint, Intensity, Noise, ReturnMode, Weather};

/// The settings of a scan. Lengths are metres, angles degrees.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// The name of the sensor.
    pub sensor: String,
    /// From the sensor to the middle of the object.
    pub distance_m: f64,
    /// How far the sensor stands above the object's horizon.
    pub elevation_deg: f64,
    /// Where it stands around the object.
    pub azimuth_deg: f64,
    /// The standard deviation of the range's noise.
    pub noise_m: f64,
    /// The rate of rain, mm/h.
    pub rain_mm_h: f64,
    /// The visibility in fog; 0 is none.
    pub fog_m: f64,
    /// The returns of a beam that the sensor reports; without, beams have no width.
    pub returns: Option<ReturnMode>,
}

impl Settings {
    /// The effects of the scan. An effect that changes nothing is left out, since it takes time.
    pub fn effects(&self) -> Effects {
        let noise = (self.noise_m != 0.0).then(|| Noise::along_range(self.noise_m));
        let weather = Weather {
            rain_mm_h: (self.rain_mm_h != 0.0).then_some(self.rain_mm_h),
            fog_visibility_m: (self.fog_m != 0.0).then_some(self.fog_m),
            ..Weather::default()
        };
        let footprint = Footprint { samples: 7, divergence_deg: None, separation_m: None };
        Effects {
            noise,
            weather: (!weather.is_clear()).then(|| Box::new(weather)),
            footprint: self.returns.map(|_| footprint),
            returns: self.returns,
            intensity: Some(Intensity),
            ..Effects::default()
        }
    }
}
