//! The files of Edgepuck that its programs embed.

/// The built-in sensor profiles: a sensor's name and its TOML.
pub const SENSORS: [(&str, &str); 20] = [
    ("vlp32c", include_str!("sensors/vlp32c.toml")),
    ("blainder-ultrapuck", include_str!("sensors/blainder-ultrapuck.toml")),
    ("generic-static", include_str!("sensors/generic-static.toml")),
    ("kinect-v2", include_str!("sensors/kinect-v2.toml")),
    ("vlp16", include_str!("sensors/vlp16.toml")),
    ("hdl64e", include_str!("sensors/hdl64e.toml")),
    ("hdl32e", include_str!("sensors/hdl32e.toml")),
    ("vls128", include_str!("sensors/vls128.toml")),
    ("os0-128", include_str!("sensors/os0-128.toml")),
    ("os1-128", include_str!("sensors/os1-128.toml")),
    ("os2-128", include_str!("sensors/os2-128.toml")),
    ("xt32", include_str!("sensors/xt32.toml")),
    ("pandar64", include_str!("sensors/pandar64.toml")),
    ("qt64", include_str!("sensors/qt64.toml")),
    ("rs-lidar-32", include_str!("sensors/rs-lidar-32.toml")),
    ("helios-5515", include_str!("sensors/helios-5515.toml")),
    ("avia", include_str!("sensors/avia.toml")),
    ("mid70", include_str!("sensors/mid70.toml")),
    ("ld19", include_str!("sensors/ld19.toml")),
    ("rplidar-a1", include_str!("sensors/rplidar-a1.toml")),
];

/// Diffuse reflectivities of materials, by name, as TOML.
pub const MATERIALS: &str = include_str!("materials.toml");

/// The corruptions of `edgepuck corrupt`, as TOML.
pub const CORRUPTIONS: &str = include_str!("corruptions.toml");

/// The built-in scene recipes, the default one first: a recipe's name and its TOML.
pub const SCENE_RECIPES: [(&str, &str); 3] = [
    ("street", include_str!("scenes/street.toml")),
    ("room", include_str!("scenes/room.toml")),
    ("yard", include_str!("scenes/yard.toml")),
];

/// The recipes of bundled models, for `edgepuck train`: a recipe's name and its TOML.
pub const TRAINING_RECIPES: [(&str, &str); 4] = [
    ("edge-64", include_str!("recipes/edge-64.toml")),
    ("cpl-64", include_str!("recipes/cpl-64.toml")),
    ("street-128", include_str!("recipes/street-128.toml")),
    ("lidar-64", include_str!("recipes/lidar-64.toml")),
];

/// The scene that `edgepuck scan` takes by default, and the mesh in it: a file's
/// path and its text. The scene is the first.
pub const DEFAULT_SCENE: [(&str, &str); 2] = [
    ("scenes/two_chairs.toml", include_str!("scenes/two_chairs.toml")),
    ("meshes/chair/chair_0046.obj", include_str!("meshes/chair/chair_0046.obj")),
];

/// Settings of `infer-cpu` with their times and accuracies, as CSV: what `edgepuck advise`
/// recommends from.
pub const ADVISE_RECORD: &str = include_str!("advise.csv");

/// The viewer of `edgepuck view` with three.js, as JavaScript.
pub const VIEWER: &str = include_str!("view/viewer.js");

/// The colours of pictures and pages, as JSON.
pub const COLOURS: &str = include_str!("view/colours.json");

/// The bundled models: a model's name and the bytes of its file.
pub const MODELS: [(&str, &[u8]); 5] = [
    ("edge-64", include_bytes!("weights/edge-64.safetensors")),
    ("set-64", include_bytes!("weights/set-64.safetensors")),
    ("street-128", include_bytes!("weights/street-128.safetensors")),
    ("street-bev", include_bytes!("weights/street-bev.safetensors")),
    ("shapes-rotational-64", include_bytes!("weights/shapes-rotational-64.safetensors")),
];
