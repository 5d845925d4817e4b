// A client of OPC UA by others (node-opcua): walks, reads each variable, and tries to write it. One JSON object on stdout.
const { OPCUAClient, AttributeIds, DataType, NodeClass } = require("node-opcua-client");

async function walk(session, node, path, found) {
  for (const each of (await session.browse(node)).references) {
    const name = each.browseName;
    if (name.namespaceIndex === 0) continue;
    const here = [...path, name.name];
    if (each.nodeClass === NodeClass.Variable) {
      const value = await session.read({ nodeId: each.nodeId, attributeId: AttributeIds.Value });
      const refused = await session.write({
        nodeId: each.nodeId, attributeId: AttributeIds.Value, value: { value: { dataType: DataType.String, value: "7" } },
      });
      found[here.join("/")] = {
        value: Array.isArray(value.value.value) ? value.value.value[0] * 2 ** 32 + value.value.value[1] : value.value.value,
        status: value.statusCode.name, time: value.sourceTimestamp, write: refused.name,
      };
    } else await walk(session, each.nodeId, here, found);
  }
}

(async () => {
  const client = OPCUAClient.create({ endpointMustExist: false, connectionStrategy: { maxRetry: 1 } });
  await client.connect(process.argv[2]);
  const session = await client.createSession();
  const found = {};
  await walk(session, "ns=0;i=85", [], found);
  await session.close();
  await client.disconnect();
  console.log(JSON.stringify(found));
  process.exit(0);
})();
