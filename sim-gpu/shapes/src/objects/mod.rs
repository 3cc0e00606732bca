//! Objects of streets, yards and rooms at real size.
//!
//! An object is a pure function of kind, seed and number. It stands on the ground with the centre
//! of its footprint at the origin; x points forward, z up, lengths are metres. The sources of the
//! ranges of sizes are stated where the ranges are.

mod building;
mod car;
mod furniture;
mod heavy_vehicle;
mod person;
mod plant;
mod pole;
mod standing;
mod street_furniture;
mod two_wheeler;

#[cfg(test)]
mod tests;

pub use standing::{Object, stand};

use formats::streams::Stream;

use crate::primitives::{Builder, Makes, Sampler, build_one};
use building::{barrier, fence, house_front, wall};
use furniture::{cabinet, door, shelf, sofa};
use heavy_vehicle::{bus, truck};
use plant::{bush, hedge, tree, trunk};
use pole::{lamp_post, traffic_light, traffic_sign};
use street_furniture::{bench, bin, clutter, cone};

/// The length of edges on curved surfaces, metres: a beam of 0.2 degrees is 0.1 m wide at 30 m.
const EDGE_M: f64 = 0.12;

/// Edges on flat surfaces are so long that no surface is divided.
const FLAT_RATIO: f64 = 1e6;

/// The makes of each kind, in the order of [`ObjectKind`].
const MAKES: [Makes; 31] = [
    &[(1, car::build)],
    truck::MAKES,
    &[(1, bus::build)],
    &[(1, two_wheeler::bicycle)],
    &[(1, two_wheeler::cyclist)],
    &[(1, two_wheeler::motorcycle)],
    &[(1, two_wheeler::motorcyclist)],
    &[(1, person::build)],
    tree::MAKES,
    bush::MAKES,
    &[(1, hedge::build)],
    &[(1, trunk::build)],
    pole::MAKES,
    lamp_post::MAKES,
    traffic_sign::MAKES,
    traffic_light::MAKES,
    &[(1, wall::build)],
    &[(1, house_front::build)],
    &[(1, fence::build)],
    barrier::MAKES,
    &[(1, cone::build)],
    &[(1, bench::build)],
    bin::MAKES,
    clutter::MAKES,
    &[(1, furniture::chair)],
    &[(1, furniture::table)],
    &[(1, sofa::build)],
    &[(1, shelf::build)],
    &[(1, door::build)],
    &[(1, cabinet::build)],
    &[(1, person::child)],
];

formats::named! {
    /// A kind of object.
    pub enum ObjectKind: "kind of object" {
        /// A sedan, hatchback, estate, SUV, van or pick-up.
        Car = "car",
        /// A lorry with a box, a tipper, a flatbed, or with a trailer.
        Truck = "truck",
        /// A city bus or a coach.
        Bus = "bus",
        /// A bicycle without a rider, on its wheels or its stand.
        Bicycle = "bicycle",
        /// A bicycle with its rider.
        Cyclist = "cyclist",
        /// A motorcycle or a scooter without a rider.
        Motorcycle = "motorcycle",
        /// A motorcycle or a scooter with its rider.
        Motorcyclist = "motorcyclist",
        /// A grown-up person who stands, walks or sits.
        Person = "person",
        /// A tree with a crown.
        Tree = "tree",
        /// A bush, irregular or cut round.
        Bush = "bush",
        /// A hedge, trimmed, with gaps.
        Hedge = "hedge",
        /// A trunk, as a sensor below the crown sees a tree.
        Trunk = "trunk",
        /// A pole or a pillar.
        Pole = "pole",
        /// A lamp post.
        LampPost = "lamp-post",
        /// A traffic sign on its post.
        TrafficSign = "traffic-sign",
        /// A traffic light.
        TrafficLight = "traffic-light",
        /// A free-standing wall.
        Wall = "wall",
        /// The front of a house with recessed windows and doors.
        HouseFront = "house-front",
        /// A fence of boards, bars or mesh.
        Fence = "fence",
        /// A crash barrier or a concrete barrier.
        Barrier = "barrier",
        /// A traffic cone.
        Cone = "traffic-cone",
        /// A bench.
        Bench = "bench",
        /// A litter bin, a wheeled bin or a container.
        Bin = "bin",
        /// A heap of boxes, a rock, a hydrant, a cabinet beside the road.
        Clutter = "clutter",
        /// A chair.
        Chair = "chair",
        /// A table.
        Table = "table",
        /// A sofa.
        Sofa = "sofa",
        /// A shelf.
        Shelf = "shelf",
        /// A door in its frame.
        Door = "door",
        /// A cabinet.
        Cabinet = "cabinet",
        /// A child who stands or walks.
        Child = "child",
    }
}

/// Builds object number `instance` of `kind` under `seed`.
#[must_use]
pub fn object(kind: ObjectKind, seed: u64, instance: u32) -> Object {
    let mut sampler = Sampler::new(Stream::Object { kind: kind.name(), instance }.key(seed));
    let mut builder = Builder::new(EDGE_M, FLAT_RATIO);
    build_one(MAKES[kind as usize], &mut builder, &mut sampler);
    let (mut mesh, glass) = builder.finish_with_glass();
    stand(&mut mesh);
    Object { mesh, glass }
}
