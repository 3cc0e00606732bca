//! Objects of streets, yards and rooms at their real size.
//!
//! An object is a pure function of (kind, seed, instance). It stands on the
//! ground at the origin: x points forward, z up, lengths are metres, and the
//! centre of its footprint is at (0, 0). Sizes are drawn from ranges whose
//! sources each file states.

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

use formats::rng::StreamKey;

use crate::primitives::{Make, Sampler};

/// The builder of each kind, in the order of [`ObjectKind`].
const BUILDERS: [Make; 31] = [
    car::build,
    heavy_vehicle::truck,
    heavy_vehicle::bus,
    two_wheeler::bicycle,
    two_wheeler::cyclist,
    two_wheeler::motorcycle,
    two_wheeler::motorcyclist,
    person::build,
    plant::tree,
    plant::bush,
    plant::hedge,
    plant::trunk,
    pole::pole,
    pole::lamp_post,
    pole::traffic_sign,
    pole::traffic_light,
    building::wall,
    building::house_front,
    building::fence,
    building::barrier,
    street_furniture::cone,
    street_furniture::bench,
    street_furniture::bin,
    street_furniture::clutter,
    furniture::chair,
    furniture::table,
    furniture::sofa,
    furniture::shelf,
    furniture::door,
    furniture::cabinet,
    person::child,
];

formats::named! {
    /// What an object is.
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
        /// The front of a house, with recessed windows and doors.
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

/// The object of `kind` number `instance`.
#[must_use]
pub fn object(kind: ObjectKind, seed: u64, instance: u32) -> Object {
    let mut sampler = Sampler::new(StreamKey::new(seed, &format!("objects/{kind}"), instance));
    Object::built(|b| BUILDERS[kind as usize](b, &mut sampler))
}
