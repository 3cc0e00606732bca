//! Checkpoints in the format of PyTorch before 1.6: a stream of pickles, then the storages of the
//! tensors.

use formats::weights::Tensor;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

pub fn write(path: &Path, tensors: &BTreeMap<String, Tensor>) {
    let mut pickle = b"\x80\x02}(".to_vec();
    for (key, (name, tensor)) in tensors.iter().enumerate() {
        push_text(&mut pickle, name);
        pickle.extend(b"ctorch._utils\n_rebuild_tensor_v2\n((");
        push_text(&mut pickle, "storage");
        pickle.extend(b"ctorch\nFloatStorage\n");
        push_text(&mut pickle, &key.to_string());
        push_text(&mut pickle, "cpu");
        push_int(&mut pickle, tensor.values.len());
        pickle.extend(b"NtQK\x00(");
        tensor.shape.iter().for_each(|&size| push_int(&mut pickle, size));
        pickle.extend(b"t(");
        for axis in 1..=tensor.shape.len() {
            push_int(&mut pickle, tensor.shape[axis..].iter().product());
        }
        pickle.extend(b"t\x89}tR");
    }
    pickle.extend(b"u.");

    let mut file = b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19.\x80\x02M\xe9\x03.\x80\x02}".to_vec();
    push_text(&mut file, "little_endian");
    file.extend(b"\x88s.");
    file.extend(pickle);
    file.extend(b"\x80\x02](");
    (0..tensors.len()).for_each(|key| push_text(&mut file, &key.to_string()));
    file.extend(b"e.");
    for tensor in tensors.values() {
        file.extend((tensor.values.len() as u64).to_le_bytes());
        file.extend(tensor.values.iter().flat_map(|value| value.to_le_bytes()));
    }
    fs::write(path, file).unwrap();
}

fn push_text(pickle: &mut Vec<u8>, text: &str) {
    pickle.push(b'X');
    pickle.extend((text.len() as u32).to_le_bytes());
    pickle.extend(text.as_bytes());
}

fn push_int(pickle: &mut Vec<u8>, value: usize) {
    pickle.push(b'J');
    pickle.extend((value as u32).to_le_bytes());
}
