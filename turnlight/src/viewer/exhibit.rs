//! One way an object looks: a scene, and the same in false colour.

use super::false_colour::{facets, most_layers, of_facet, of_rank, painted, ranks};
use crate::Error;
use crate::scene::Scene;
use std::path::Path;
use std::sync::OnceLock;

/// A scene and what it is called; where several are shown they are the same object by other methods.
#[derive(Clone, Debug)]
pub struct Exhibit {
    /// What somebody chooses it by.
    pub name: String,
    /// What is shown.
    pub scene: Scene,
    facets: OnceLock<Scene>,
    ranks: OnceLock<Scene>,
    most_layers: OnceLock<usize>,
}

impl Exhibit {
    /// A scene by this name.
    pub fn new(name: String, scene: Scene) -> Self {
        Self { name, scene, facets: OnceLock::new(), ranks: OnceLock::new(), most_layers: OnceLock::new() }
    }

    /// The same with every facet in a colour of its own; painted when it is first asked for.
    pub fn facets(&self) -> &Scene {
        self.facets.get_or_init(|| painted(&self.scene, facets, |facet| of_facet(usize::from(facet))))
    }

    /// The same in the colours of how many layers a facet has, likewise.
    pub fn ranks(&self) -> &Scene {
        // From one to the most.
        let most = self.most_layers().saturating_sub(1).max(1) as f64;
        let share = |rank: u16| f64::from(rank.saturating_sub(1)) / most;
        self.ranks.get_or_init(|| painted(&self.scene, ranks, |rank| of_rank(share(rank))))
    }

    /// The most layers that any facet has; of lumigraphs, rays.
    pub fn most_layers(&self) -> usize {
        *self.most_layers.get_or_init(|| most_layers(&self.scene))
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
