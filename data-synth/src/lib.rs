//! data-synth
