//! Errors of casting.

/// Casting failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CastError {
    /// No adapter has the requested name.
    #[error("expected an adapter whose name holds {wanted:?}, found {}", present.join(", "))]
    NoSuchAdapter {
        /// The requested name.
        wanted: String,
        /// The names of the adapters.
        present: Vec<String>,
    },
    /// An adapter was requested from a build without GPU support.
    #[error(
        "expected an adapter whose name holds {wanted:?}, but this program was built without GPU \
         support: build it with `--features gpu`, or take the adapter \"cpu\""
    )]
    NoGpuSupport {
        /// The requested name.
        wanted: String,
    },
    /// The adapter does not open.
    #[error("adapter {name}: {cause}; try --adapter cpu")]
    Open {
        /// The adapter.
        name: String,
        /// The cause.
        cause: String,
    },
    /// A mesh is too large for the adapter's bindings.
    #[error("adapter {name}: a mesh of {nodes} nodes exceeds a binding of {binding_bytes} bytes")]
    TooLarge {
        /// The adapter.
        name: String,
        /// The mesh's nodes.
        nodes: usize,
        /// The limit.
        binding_bytes: usize,
    },
    /// The device stopped answering.
    #[error("adapter {name}: {cause}; try --adapter cpu")]
    Lost {
        /// The adapter.
        name: String,
        /// The error of the device.
        cause: String,
    },
}
