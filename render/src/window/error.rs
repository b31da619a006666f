//! Why no window opens, with what to do in its place.

/// A fault of the display or of the adapter that draws on it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WindowError {
    /// No screen to open a window on.
    #[error(
        "no window can be opened ({fault}); show the model in a browser with --web, draw it with `turnlight render`, or \
         set DISPLAY or WAYLAND_DISPLAY"
    )]
    NoDisplay {
        /// What the system said.
        fault: String,
    },
    /// A screen, and nothing that draws on it.
    #[error(
        "no graphics adapter draws in a window here ({fault}); install a Vulkan driver (Debian: mesa-vulkan-drivers), \
         show the model in a browser with --web, or draw it with `turnlight render`"
    )]
    NoAdapter {
        /// What the system said.
        fault: String,
    },
    /// The driver refused or failed.
    #[error("{adapter} cannot draw the window ({fault}); show the model in a browser with --web, or update the driver")]
    Driver {
        /// The adapter's name.
        adapter: String,
        /// What the driver said.
        fault: String,
    },
}
