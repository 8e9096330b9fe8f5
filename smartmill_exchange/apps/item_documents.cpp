// rosrun smartmill_exchange item_documents docs/exchange.md smartmill_exchange/schema/observation.json:
// writes the table of data items into the documentation, and the JSON schema.

#include <string>

#include "smartmill_core/io/text_file.h"
#include "smartmill_core/program.h"
#include "smartmill_exchange/items/catalogue.h"
#include "smartmill_exchange/items/json.h"

int main(int argc, char** argv) {
  smartmill::CommandLine line("Writes the data items into a document, and the JSON schema of their values.");
  std::string document, schema;
  line.option("document", document, "docs/exchange.md").required().existingFile();
  line.option("schema", schema, "smartmill_exchange/schema/observation.json").required();
  return smartmill::runProgram(line, argc, argv, [&] {
    smartmill::writeText(document, smartmill::exchange::withItemTable(smartmill::readText(document)));
    smartmill::writeText(schema, smartmill::exchange::observationSchema());
  });
}
