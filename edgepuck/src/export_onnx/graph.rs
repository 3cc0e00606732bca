//! A graph under construction. A node has the name of its first output.

use std::collections::BTreeMap;

use super::proto::{
    AttributeProto, Dimension, GraphProto, NodeProto, TensorProto, TensorShapeProto,
    TensorTypeProto, TypeProto, ValueInfoProto, attribute_type, data_type,
};

/// Nodes in the order of their addition, and constants by name.
#[derive(Default)]
pub struct Graph {
    nodes: Vec<NodeProto>,
    constants: BTreeMap<String, TensorProto>,
    inputs: Vec<ValueInfoProto>,
    outputs: Vec<ValueInfoProto>,
}

/// The size of an axis.
#[derive(Clone, Copy)]
pub enum Size<'a> {
    /// Known now.
    Fixed(usize),
    /// Known only when the model runs.
    Named(&'a str),
}

impl Graph {
    /// Adds an input of f32 and returns its name.
    pub fn input(&mut self, name: &str, shape: &[Size<'_>]) -> String {
        self.inputs.push(value(name, data_type::FLOAT, shape));
        name.to_owned()
    }

    /// Declares value `name` an output with this kind of elements.
    pub fn output(&mut self, name: &str, elements: i32, shape: &[Size<'_>]) {
        self.outputs.push(value(name, elements, shape));
    }

    /// Adds a node with one output, `name`, and returns the name.
    pub fn add(
        &mut self,
        operator: &str,
        name: &str,
        inputs: &[&str],
        attributes: Vec<AttributeProto>,
    ) -> String {
        self.add_of_many(operator, &[name], inputs, attributes);
        name.to_owned()
    }

    pub fn add_of_many(
        &mut self,
        operator: &str,
        outputs: &[&str],
        inputs: &[&str],
        attribute: Vec<AttributeProto>,
    ) {
        self.nodes.push(NodeProto {
            input: inputs.iter().map(ToString::to_string).collect(),
            output: outputs.iter().map(ToString::to_string).collect(),
            name: outputs[0].to_owned(),
            op_type: operator.to_owned(),
            attribute,
        });
    }

    /// Adds a constant of f32 and returns its name.
    pub fn reals(&mut self, name: &str, shape: &[usize], values: &[f32]) -> String {
        let raw_data = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.constant(name, data_type::FLOAT, shape, raw_data)
    }

    /// Adds a constant of whole numbers and returns its name. Equal lists are one constant.
    pub fn whole(&mut self, values: &[i64]) -> String {
        let words: Vec<String> = values.iter().map(ToString::to_string).collect();
        let raw_data = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let name = format!("int64.{}", words.join("."));
        self.constant(&name, data_type::INT64, &[values.len()], raw_data)
    }

    fn constant(&mut self, name: &str, kind: i32, shape: &[usize], raw_data: Vec<u8>) -> String {
        let dims = shape.iter().map(|&size| size as i64).collect();
        let tensor = TensorProto { dims, data_type: kind, name: name.to_owned(), raw_data };
        self.constants.insert(name.to_owned(), tensor);
        name.to_owned()
    }

    pub fn finish(self, name: &str) -> GraphProto {
        GraphProto {
            node: self.nodes,
            name: name.to_owned(),
            initializer: self.constants.into_values().collect(),
            input: self.inputs,
            output: self.outputs,
        }
    }
}

fn value(name: &str, elem_type: i32, shape: &[Size<'_>]) -> ValueInfoProto {
    let dim = shape
        .iter()
        .map(|size| match size {
            Size::Fixed(n) => Dimension { dim_value: Some(*n as i64), dim_param: None },
            Size::Named(name) => Dimension { dim_value: None, dim_param: Some((*name).to_owned()) },
        })
        .collect();
    let tensor_type = TensorTypeProto { elem_type, shape: Some(TensorShapeProto { dim }) };
    ValueInfoProto {
        name: name.to_owned(),
        r#type: Some(TypeProto { tensor_type: Some(tensor_type) }),
    }
}

pub fn int(name: &str, i: i64) -> AttributeProto {
    AttributeProto { i, ..attribute(name, attribute_type::INT) }
}

pub fn ints(name: &str, ints: &[i64]) -> AttributeProto {
    AttributeProto { ints: ints.to_vec(), ..attribute(name, attribute_type::INTS) }
}

pub fn word(name: &str, word: &str) -> AttributeProto {
    AttributeProto { s: word.into(), ..attribute(name, attribute_type::STRING) }
}

fn attribute(name: &str, kind: i32) -> AttributeProto {
    AttributeProto { name: name.to_owned(), r#type: kind, ..Default::default() }
}
