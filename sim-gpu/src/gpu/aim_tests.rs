use super::adapters;
use super::batch::View;
use super::compose::constants;
use crate::cpu::aim::tests;
use crate::fixed_frame::{FixedFrame, fixed_direction};
use crate::ray::TraceRay;
use edgepuck_shaders as shaders;
use test_support::need;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

const MAIN: &str = include_str!("aim_tests.wgsl");

/// The rays that the shader makes on the best adapter.
fn made(views: &[View], beams: &[[i32; 4]]) -> Result<Vec<TraceRay>, String> {
    let adapter = test_support::adapter(pollster::block_on(adapters()).into_iter().next())?;
    let (device, queue) = pollster::block_on(adapter.request_device(&Default::default())).unwrap();
    let wgsl = [&constants(), shaders::RAY, shaders::AIM, MAIN].concat();
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(wgsl.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: Default::default(),
        cache: None,
    });
    let buffer = |contents, usage| {
        device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage })
    };
    let none = vec![0; size_of::<TraceRay>() * views.len()];
    let buffers = [
        buffer(bytemuck::cast_slice(views), wgpu::BufferUsages::STORAGE),
        buffer(bytemuck::cast_slice(beams), wgpu::BufferUsages::STORAGE),
        buffer(&none, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC),
        buffer(&none, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
    ];
    let entries = (0..3).zip(&buffers).map(|(binding, buffer)| wgpu::BindGroupEntry {
        binding,
        resource: buffer.as_entire_binding(),
    });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries.collect::<Vec<_>>(),
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups(views.len().div_ceil(64) as u32, 1, 1);
    drop(pass);
    encoder.copy_buffer_to_buffer(&buffers[2], 0, &buffers[3], 0, none.len() as u64);
    queue.submit([encoder.finish()]);
    buffers[3].slice(..).map_async(wgpu::MapMode::Read, |mapped| mapped.unwrap());
    device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    Ok(bytemuck::pod_collect_to_vec(&buffers[3].slice(..).get_mapped_range().unwrap()[..]))
}

#[test]
fn the_shader_makes_the_rays_of_its_twin() {
    let (mut views, mut beams, mut expected) = (vec![], vec![], vec![]);
    for (origin, turn) in tests::sensors() {
        let fixed = FixedFrame::new(origin, &turn, 1.7).unwrap();
        for beam in tests::beams(origin, &turn).into_iter().map(fixed_direction) {
            views.push(View { root: views.len() as u32, ..View::from(&fixed) });
            beams.push([beam[0], beam[1], beam[2], 0]);
            expected.push(fixed.aim(beam));
        }
    }
    let made = need!(made(&views, &beams));
    for (i, (ray, expected)) in made.iter().zip(&expected).enumerate() {
        let number = |x: i32, unit: f32| x as f32 * unit;
        // Origins of rays that may hit are exact in f32.
        let is_exact = expected.origin.iter().all(|x| x.abs() <= 1 << 24);
        let origin = expected.origin.map(|x| number(x, 2.0f32.powi(-23)));
        assert!(!is_exact || ray.origin == origin, "ray {i}: {ray:?}, {expected:?}");
        assert_eq!(ray.direction, expected.direction.map(|x| number(x, 2.0f32.powi(-24))));
        assert_eq!(ray.root, i as u32);
    }
    assert_eq!(made.len(), expected.len());
}
