//! Tests across crates, a module for each question.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

mod analytic;
mod bvh_properties;
mod combined_effects;
mod dataset_finish;
mod dataset_merge;
mod dataset_on_demand;
mod effects_parity;
mod footprint;
mod motion;
mod noise_statistics;
mod off_properties;
mod only_what_is_asked;
mod packets;
mod parity;
mod real_meshes;
mod received_power;
mod scan_effects;
mod shaders_valid;
mod streams;
mod watertight;
mod weather;
