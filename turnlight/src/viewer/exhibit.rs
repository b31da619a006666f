//! One way an object looks: a scene, and the same in false colour.

use super::false_colour::{facets, most_layers, of_facet, of_rank, painted, ranks};
use crate::Error;
use crate::scene::Scene;
use std::path::Path;

/// A scene and what it is called; where several are shown they are the same object by other methods.
#[derive(Clone, Debug)]
pub struct Exhibit {
    /// What somebody chooses it by.
    pub name: String,
    /// What is shown.
    pub scene: Scene,
    /// The same with every facet in a colour of its own.
    pub facets: Scene,
    /// The same in the colours of how many layers a facet has.
    pub ranks: Scene,
    /// The most that any has; of lumigraphs, rays.
    pub most_layers: usize,
}

impl Exhibit {
    /// A scene by this name.
    pub fn new(name: String, scene: Scene) -> Self {
        let most_layers = most_layers(&scene);
        // From one to the most.
        let most = most_layers.saturating_sub(1).max(1) as f64;
        let share = |rank: u16| f64::from(rank.saturating_sub(1)) / most;
        Self {
            name,
            facets: painted(&scene, facets, |facet| of_facet(usize::from(facet))),
            ranks: painted(&scene, ranks, |rank| of_rank(share(rank))),
            most_layers,
            scene,
        }
    }

    /// Reads models or scenes (`.json`) and names them: by their method where that tells them apart, by their files
    /// otherwise.
    ///
    /// # Errors
    /// As [`Scene::read`].
    pub fn read_all<P: AsRef<Path>>(paths: &[P]) -> Result<Vec<Self>, Error> {
        let scenes = paths.iter().map(|path| Scene::read(path.as_ref())).collect::<Result<Vec<_>, _>>()?;
        let methods: Vec<Option<&str>> = scenes.iter().map(method).collect();
        let tells_apart = |k: usize| methods[k].is_some() && (0..k).all(|j| methods[j] != methods[k]);
        let by_method = (0..methods.len()).all(tells_apart);
        let stem = |path: &Path| path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let named = |k: usize| match methods[k] {
            Some(method) if by_method => method.to_owned(),
            _ => stem(paths[k].as_ref()),
        };
        let names: Vec<String> = (0..scenes.len()).map(named).collect();
        Ok(names.into_iter().zip(scenes).map(|(name, scene)| Self::new(name, scene)).collect())
    }
}

/// The method of a scene of one model.
fn method(scene: &Scene) -> Option<&'static str> {
    match scene.models.as_slice() {
        [model] if scene.objects.len() == 1 => Some(model.method.name()),
        _ => None,
    }
}
