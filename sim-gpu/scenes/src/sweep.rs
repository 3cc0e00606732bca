//! Sweeps: scans of a whole scene, each over one revolution of its sensor.

use std::sync::Arc;

use edgepuck_mesh::TriangleMesh;
use formats::Scan;
use formats::rng::StreamKey;
use formats::scan::Attribute;
use formats::streams::Stream;
use glam::DVec3;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::scan::{PlacedTarget, ScanRequest, scan_objects};
use sim_gpu::{Effects, Scene, Sensor};

use crate::error::SceneError;
use crate::model::shared;
use crate::scene::DrawnScene;
use crate::stage::{Stage, StageSensor};

/// One revolution of a sensor in a scene.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// The points in the order of firing, in the sensor's frame, metres, with range, beam, ring,
    /// time, object and intensity. Object 0 is the ground, and object `i` is `i - 1` of [`DrawnScene::objects`].
    pub scan: Scan,
}

impl Stage {
    /// The sensor of `scene`.
    #[must_use]
    pub fn sensor(&self, scene: &DrawnScene) -> &Sensor {
        &self.sensors[scene.sensor].sensor
    }

    /// The length, width and height of object `i` of `scene`, metres.
    #[must_use]
    pub fn size_m(&self, scene: &DrawnScene, i: usize) -> DVec3 {
        self.size_of(&scene.objects[i])
    }

    /// The ground and the objects of `scene` as instances: instance 0 is the ground, and instance
    /// `i` is object `i - 1` of `scene`, labelled with its class.
    #[must_use]
    pub fn build(&self, scene: &DrawnScene) -> Scene {
        let mut world = Scene::new();
        (world.seed, world.effects) = (self.seed(), self.effects(scene).clone());
        world.attributes.insert(Attribute::Intensity);
        let ground = shared(scene.ground.mesh(), Builder::Morton);
        self.add_ground(&mut world, &ground, scene.number);
        for object in &scene.objects {
            self.add_object(&mut world, object, scene.glass_returned);
        }
        world
    }

    /// Scans the ground and all objects of `scene`.
    ///
    /// # Errors
    /// The caster fails.
    pub fn sweep(&self, scene: &DrawnScene) -> Result<Sweep, SceneError> {
        let world = self.build(scene);
        let placed = world.placed(|_, number| Some(self.stream(scene, number)));
        self.scan_placed(&world, &placed, scene)
    }

    /// Scans `world` with the sensor of `scene`.
    ///
    /// # Errors
    /// The caster fails.
    #[doc(hidden)]
    pub fn sweep_in(&self, world: &Scene, scene: &DrawnScene) -> Result<Sweep, SceneError> {
        self.scan_placed(world, &world.placed(|_, _| None), scene)
    }

    /// Scans the instances of `world`, as they are `placed`.
    pub(crate) fn scan_placed(
        &self,
        world: &Scene,
        placed: &[PlacedTarget],
        scene: &DrawnScene,
    ) -> Result<Sweep, SceneError> {
        let StageSensor { sensor, caster } = &self.sensors[scene.sensor];
        let pattern = sensor.rays(caster.effects())?;
        let mut request = ScanRequest::new(sensor.profile(), &pattern, scene.pose);
        request.attributes.clone_from(&world.attributes);
        request.motion = scene.motion(pattern.last_s()).map(Arc::new);
        request.stream = self.stream(scene, u32::MAX);
        let scan = scan_objects(caster, placed, &request)?.scan;
        Ok(Sweep::new(scan, scene))
    }

    pub(crate) fn effects(&self, scene: &DrawnScene) -> &Effects {
        self.sensors[scene.sensor].caster.effects()
    }

    /// The key of the random numbers of instance number `part` in scans of `scene`.
    pub(crate) fn stream(&self, scene: &DrawnScene, part: u32) -> StreamKey {
        Stream::SceneBeams { scene: scene.number, part }.key(self.seed())
    }

    /// The ground and the objects of `scene` as one mesh, in which the objects lose their numbers
    /// and materials.
    #[doc(hidden)]
    #[must_use]
    pub fn mesh(&self, scene: &DrawnScene) -> TriangleMesh {
        let mut whole = scene.ground.mesh();
        for object in &scene.objects {
            let world_from_object = object.world_from_object();
            let surface = &self.model(object.entry, object.variant).mesh.target().surface;
            for &index in surface.kept() {
                let first = whole.vertices.len() as u32;
                let corners = surface.corners(index).map(|corner| surface.frame.to_object(corner));
                whole.vertices.extend(corners.map(|at| world_from_object.transform_point3(at)));
                whole.triangles.push([first, first + 1, first + 2]);
            }
        }
        whole
    }
}

impl Sweep {
    /// Moves the points of `scan` from the scene's frame to the sensor's.
    fn new(mut scan: Scan, scene: &DrawnScene) -> Self {
        let sensor_from_world = scene.pose.rotation.inverse();
        let origin = DVec3::from_array(std::mem::take(&mut scan.origin)) - scene.pose.position_m;
        for point in &mut scan.positions {
            let from_sensor = DVec3::from_array(point.map(f64::from)) + origin;
            *point = (sensor_from_world * from_sensor).as_vec3().to_array();
        }
        Self { scan }
    }

    /// The points in the sensor's frame, metres.
    #[must_use]
    pub fn points(&self) -> &[[f32; 3]] {
        &self.scan.positions
    }

    /// The ring of each point, counted from the lowest elevation.
    #[must_use]
    pub fn rings(&self) -> &[u16] {
        self.scan.ring.as_deref().expect("invariant: a sweep is scanned with rings")
    }

    /// The surface that each point lies on, numbered as in [`Sweep::scan`].
    #[must_use]
    pub fn surfaces(&self) -> &[u32] {
        self.scan.object.as_deref().expect("invariant: a sweep is scanned with objects")
    }

    /// The mean time of the points on `surface`, seconds since the start of the scan; 0 if it has none.
    pub(crate) fn mean_time_s(&self, surface: u32) -> f64 {
        let times = self.scan.time_s.as_deref().unwrap_or_default();
        let own = times.iter().zip(self.surfaces()).filter(|(_, of)| **of == surface);
        let (n, sum) = own.fold((0u32, 0.0), |(n, sum), (time, _)| (n + 1, sum + f64::from(*time)));
        sum / f64::from(n.max(1))
    }

    /// The number of points on the ground, on each object of `scene`, and, last, in the air.
    /// `scene` must be the scene of this sweep.
    #[must_use]
    pub fn points_by_surface(&self, scene: &DrawnScene) -> Vec<u32> {
        let air = scene.objects.len() + 1;
        let mut counts = vec![0; air + 1];
        self.surfaces().iter().for_each(|&surface| counts[air.min(surface as usize)] += 1);
        counts
    }
}
