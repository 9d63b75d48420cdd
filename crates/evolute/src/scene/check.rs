//! Description → [`Scene`].

use super::description::{Kind, Object, SceneDescription, Value};
use super::material::Materials;
use super::message::{Checked, Complaint, SceneError, quoted};
use super::model::Scene;
use super::{schema, sensor, shape};

/// Integrators that compute the same light: nobody need be told that another one does.
const SAME_LIGHT: [&str; 2] = ["path", "ptracer"];

impl SceneDescription {
    /// Checks everything and builds the scene, with notices for the user (one sentence each) about
    /// what was read and is not used.
    ///
    /// # Errors
    /// The first fault, with its place and what would be right.
    pub fn scene(&self) -> Result<(Scene, Vec<String>), SceneError> {
        self.checked().map_err(|complaint| complaint.render(&self.sources))
    }

    fn checked(&self) -> Checked<(Scene, Vec<String>)> {
        schema::check(self)?;
        let mut notices = Vec::new();
        let root = &self.objects[0];
        let max_depth = self.integrator(root, &mut notices)?;
        let mut materials = Materials::new(self);
        let mut shapes = Vec::new();
        let mut sensors = Vec::new();
        for child in &root.children {
            let object = &self.objects[child.object];
            match object.kind {
                Kind::Shape => {
                    shapes.push(shape::shape(self, &mut materials, object, shapes.len() + 1)?);
                }
                Kind::Sensor => sensors.push(sensor::sensor(self, object, &mut notices)?),
                // Nothing else uses them; checked all the same.
                Kind::Bsdf => drop(materials.of(child.object)?),
                Kind::Emitter => drop(shape::radiance(object)?),
                _ => {}
            }
        }
        if shapes.iter().all(|s| s.radiance.is_black()) {
            notices.push("the scene has no lamp: nothing is lit".to_string());
        }
        Ok((Scene { name: self.name.clone(), shapes, sensors, max_depth }, notices))
    }

    /// The integrator's depth limit; what else it asks for is answered with one notice.
    fn integrator(&self, root: &Object, notices: &mut Vec<String>) -> Checked<Option<u32>> {
        let integrators: Vec<_> = self.children_of(root, Kind::Integrator).collect();
        let first = match integrators.as_slice() {
            [] => return Ok(None),
            [first] => &self.objects[first.object],
            [first, second, ..] => {
                return Err(Complaint::at(second.span, "a second integrator")
                    .related(first.span, "the first")
                    .help("a scene has one: remove the other"));
            }
        };
        // Integrators such as "aov" hold the one that transports light.
        let mut integrator = first;
        while integrator.property("max_depth").is_none()
            && let Some(inner) = self.children_of(integrator, Kind::Integrator).next()
        {
            integrator = &self.objects[inner.object];
        }
        let depth = match integrator.property("max_depth").map(|p| &p.value) {
            None | Some(Value::Integer(-1)) => None,
            Some(_) => {
                integrator.integer_in("max_depth", -1, i64::from(u32::MAX))?.map(|d| d as u32)
            }
        };
        let name = quoted(&first.plugin.value);
        if let Some(depth) = depth {
            notices.push(format!(
                "the integrator {name} is not used, but its max_depth {depth} limits chains of mirrors and lenses here, too, \
                 and leaves out indirect light if it allows no diffuse reflection; remove it to limit nothing"
            ));
        } else if !SAME_LIGHT.contains(&first.plugin.value.as_str()) {
            notices.push(format!(
                "the integrator {name} is not used: evolute computes all light in its own way"
            ));
        }
        Ok(depth)
    }
}
