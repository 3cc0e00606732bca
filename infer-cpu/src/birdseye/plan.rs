//! The steps of the network, in order.

/// The classes whose scores come first.
pub const CLASSES: [&str; 4] = ["car", "person", "two-wheeler", "truck"];
pub const N_CLASSES: usize = CLASSES.len();
/// The number of persons among them.
pub const PERSON: usize = 1;
/// After the scores come, of the object about a cell: the offset of its centre along x and y (cells), the
/// logarithms of its length, width and height (metres), and the cosine and sine of twice its yaw.
const N_BOX: usize = 7;
/// The outputs of a cell of 0.4 m: each of the above for its four quarters.
pub const OUTPUTS: usize = 4 * (N_CLASSES + N_BOX);

/// A step: its layer's name, and what it computes.
pub struct Step {
    pub name: &'static str,
    pub of: Of,
}

/// What a step computes of the results of earlier steps, which are named by their numbers.
#[derive(Clone, Copy)]
pub enum Of {
    /// A layer on each cell of the image.
    Image,
    /// A convolution with a kernel of `size` cells, for every cell or for every second one.
    Conv { from: usize, size: usize, stride: usize },
    /// The sum of one result, and of another one of half the size.
    Sum { whole: usize, half: usize },
}

const fn conv(name: &'static str, from: usize, size: usize, stride: usize) -> Step {
    Step { name, of: Of::Conv { from, size, stride } }
}

const fn sum(name: &'static str, whole: usize, half: usize) -> Step {
    Step { name, of: Of::Sum { whole, half } }
}

/// Down from cells of 0.2 m to 3.2 m, and up to 0.4 m: a U-net (Ronneberger et al. 2015) whose ways
/// up are added. The last step has no ReLU.
pub const STEPS: [Step; 22] = [
    Step { name: "cell", of: Of::Image },
    conv("down1", 0, 3, 2),
    conv("a1", 1, 3, 1),
    conv("down2", 2, 3, 2),
    conv("b1", 3, 3, 1),
    conv("b2", 4, 3, 1),
    conv("down3", 5, 3, 2),
    conv("c1", 6, 3, 1),
    conv("c2", 7, 3, 1),
    conv("down4", 8, 3, 2),
    conv("d1", 9, 3, 1),
    conv("d2", 10, 3, 1),
    conv("up3", 11, 1, 1),
    sum("sum3", 8, 12),
    conv("join3", 13, 3, 1),
    conv("up2", 14, 1, 1),
    sum("sum2", 5, 15),
    conv("join2", 16, 3, 1),
    conv("up1", 17, 1, 1),
    sum("sum1", 2, 18),
    conv("join1", 19, 3, 1),
    conv("head", 20, 1, 1),
];

/// The last step.
pub const HEAD: usize = STEPS.len() - 1;
