//! Why the graphics hardware does not play, with what then happens in the message.

/// A fault of the adapter, or a model or camera that it cannot play. The CPU plays all of them.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// Nothing to draw with.
    #[error(
        "no graphics adapter ({fault}); let the CPU play, or install a Vulkan driver (Debian: mesa-vulkan-drivers)"
    )]
    NoAdapter {
        /// What the system said.
        fault: String,
    },
    /// Something does not fit.
    #[error("{what}, where {adapter} takes {limit}; let the CPU play, or make the model smaller")]
    TooLarge {
        /// What, with its size.
        what: String,
        /// The adapter's name.
        adapter: String,
        /// How much it takes.
        limit: String,
    },
    /// Something that only the CPU draws.
    #[error("{what} is not drawn on graphics hardware; let the CPU play")]
    Unsupported {
        /// What.
        what: String,
    },
    /// The driver refused or failed.
    #[error("{adapter}: {fault}; let the CPU play, or update the driver")]
    Driver {
        /// The adapter's name.
        adapter: String,
        /// What the driver said.
        fault: String,
    },
}
