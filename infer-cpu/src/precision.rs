use edgepuck_kernels::Kernels;

formats::named! {
    /// The number format of a network.
    #[derive(Default)]
    pub enum Precision: "precision" {
        /// fp32 throughout.
        #[default]
        F32 = "f32",
        /// int8 weights (one scale per channel) and seven-bit activations (one calibrated scale per
        /// layer). The first layer, whose inputs are coordinates, is in fp32; vector layers have
        /// int8 weights and fp32 arithmetic.
        I8 = "i8",
    }
}

impl Precision {
    /// Whether `kernels` support it.
    #[must_use]
    pub fn runs_on(self, kernels: &Kernels) -> bool {
        match self {
            Self::F32 => true,
            Self::I8 => kernels.i8.is_some(),
        }
    }
}
