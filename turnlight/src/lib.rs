//! turnlight
