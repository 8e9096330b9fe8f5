// Decodes ROS 1 messages from their definition, as advertised by the panel's server.

const NUMBERS = {
  bool: ['getUint8', 1], int8: ['getInt8', 1], byte: ['getInt8', 1], uint8: ['getUint8', 1], char: ['getUint8', 1],
  int16: ['getInt16', 2], uint16: ['getUint16', 2], int32: ['getInt32', 4], uint32: ['getUint32', 4],
  int64: ['getBigInt64', 8], uint64: ['getBigUint64', 8], float32: ['getFloat32', 4], float64: ['getFloat64', 8],
};
const ARRAYS = {
  float64: Float64Array, float32: Float32Array, uint8: Uint8Array, int8: Int8Array, int32: Int32Array,
  uint32: Uint32Array, int16: Int16Array, uint16: Uint16Array,
};
const FIELD = /^([\w/]+)(\[(\d*)\])?\s+(\w+)$/;

function fieldsOf(text) {
  const fields = [];
  for (const raw of text.split('\n')) {
    const line = raw.replace(/#.*/, '').trim();
    const match = line.includes('=') ? null : line.match(FIELD);
    if (match) fields.push({ type: match[1], array: match[2] !== undefined, count: match[3] ? +match[3] : -1, name: match[4] });
  }
  return fields;
}

// {type: fields} of a definition including its nested types.
function typesOf(definition, type) {
  const types = {};
  definition.split(/^={10,}$/m).forEach((part, index) => {
    const name = index ? part.match(/^\s*MSG:\s*(\S+)/)[1] : type;
    types[name] = fieldsOf(part.replace(/^\s*MSG:.*$/m, ''));
  });
  return types;
}

class Cursor {
  constructor(view) { this.view = view; this.at = 0; this.text = new TextDecoder(); }
  number(type) {
    const [read, size] = NUMBERS[type];
    const value = this.view[read](this.at, true);
    this.at += size;
    return typeof value === 'bigint' ? Number(value) : value;
  }
  string() {
    const length = this.number('uint32');
    const value = this.text.decode(new Uint8Array(this.view.buffer, this.view.byteOffset + this.at, length));
    this.at += length;
    return value;
  }
  // Copied, because typed arrays require alignment.
  array(type, count) {
    const begin = this.view.byteOffset + this.at, size = count * NUMBERS[type][1];
    this.at += size;
    return new ARRAYS[type](this.view.buffer.slice(begin, begin + size));
  }
}

// @return a function that decodes a DataView to an object
export function readerOf(definition, type) {
  const types = typesOf(definition, type);
  const resolve = (name, from) => {
    if (name === 'Header') return 'std_msgs/Header';
    return name.includes('/') ? name : `${from.split('/')[0]}/${name}`;
  };
  const one = (cursor, name, from) => {
    if (name === 'bool') return cursor.number(name) !== 0;
    if (NUMBERS[name]) return cursor.number(name);
    if (name === 'string') return cursor.string();
    if (name === 'time') return cursor.number('uint32') + 1e-9 * cursor.number('uint32');
    if (name === 'duration') return cursor.number('int32') + 1e-9 * cursor.number('int32');
    return object(cursor, resolve(name, from));
  };
  const object = (cursor, name) => {
    const result = {};
    for (const field of types[name]) {
      if (!field.array) {
        result[field.name] = one(cursor, field.type, name);
        continue;
      }
      const count = field.count >= 0 ? field.count : cursor.number('uint32');
      result[field.name] = ARRAYS[field.type] ? cursor.array(field.type, count)
        : Array.from({ length: count }, () => one(cursor, field.type, name));
    }
    return result;
  };
  return view => object(new Cursor(view), type);
}
