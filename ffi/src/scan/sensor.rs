use std::ffi::c_char;
use std::mem::MaybeUninit;
use std::ptr::null;

use sim_gpu::Sensor;

use crate::pointers;
use crate::status::{EdgepuckStatus, Failure, guard};

/// A LiDAR or depth camera.
pub struct EdgepuckSensor {
    pub(crate) sensor: Sensor,
}

/// The beams of a sensor, in the order of firing; the arrays are valid as long as the sensor.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EdgepuckBeams {
    /// The number of beams.
    pub n_beams: usize,
    /// Unit vectors in the sensor's frame, x y z after x y z.
    pub directions: *const f64,
    /// Rings, counted from below.
    pub rings: *const u16,
    /// Times of firing, seconds since the revolution began.
    pub times_s: *const f64,
}

/// Opens the built-in sensor of this name, such as "vlp32c", or the sensor of this file: a profile
/// (.toml), or the metadata of an Ouster (.json). Writes the sensor to out, or null if it fails. Pass it
/// to edgepuck_sensor_free in the end.
///
/// # Safety
///
/// name_or_file is null or a NUL-terminated string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_sensor_open(
    name_or_file: *const c_char,
    out: Option<&mut MaybeUninit<Option<Box<EdgepuckSensor>>>>,
) -> EdgepuckStatus {
    pointers::make(out, || {
        // SAFETY: null or NUL-terminated, as required above.
        let sensor = Sensor::resolve(&unsafe { pointers::text(name_or_file, "name_or_file") }?);
        Ok(EdgepuckSensor { sensor: sensor.map_err(Failure::of(EdgepuckStatus::BadSensor))? })
    })
}

/// The beams of a sensor; none of a null sensor.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_sensor_beams(sensor: Option<&EdgepuckSensor>) -> EdgepuckBeams {
    let beams = guard(|| {
        let sensor = &pointers::need(sensor, "sensor")?.sensor;
        Ok(EdgepuckBeams {
            n_beams: sensor.directions().len(),
            directions: sensor.directions().as_ptr().cast(),
            rings: sensor.rings().as_ptr(),
            times_s: sensor.times_s().as_ptr(),
        })
    });
    let none = EdgepuckBeams { n_beams: 0, directions: null(), rings: null(), times_s: null() };
    beams.unwrap_or(none)
}

/// Frees a sensor; null has no effect.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_sensor_free(sensor: Option<Box<EdgepuckSensor>>) {
    pointers::free(sensor);
}
